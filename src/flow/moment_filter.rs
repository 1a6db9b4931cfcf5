//! One-dimensional filters of a window: its weights, and up to three filters of a line in one pass.

use crate::simd::Lanes;

/// Weights at distance 0 ..= radius of the one-dimensional Gaussian whose full sum is 1.
pub(in crate::flow) fn weights(sigma: f64, radius: usize) -> Vec<f64> {
    let raw: Vec<f64> = (0..=radius).map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp()).collect();
    let sum = raw[0] + 2.0 * raw[1..].iter().rev().sum::<f64>();
    raw.iter().map(|w| w / sum).collect()
}

/// Row lengths are multiples of this many samples, so that no loop below has a tail.
pub(in crate::flow) const CHUNK: usize = 32;

/// Filters `len` samples (a multiple of [`CHUNK`]) of `source` from `centre` on with the first `N` filters of
/// `taps`, neighbours being `stride` apart.
#[inline(always)]
pub(in crate::flow) fn filter<V: Lanes, const N: usize>(
    source: &[V::Scalar],
    centre: usize,
    stride: usize,
    len: usize,
    taps: &[[V::Scalar; 3]],
    out: [&mut [V::Scalar]; N],
) {
    // Enough sums in flight to hide the latency of an addition, few enough to stay in registers.
    if N == 3 || V::LANES > 8 {
        filter_unrolled::<V, N, 2>(source, centre, stride, len, taps, out);
    } else {
        filter_unrolled::<V, N, 4>(source, centre, stride, len, taps, out);
    }
}

#[inline(always)]
fn filter_unrolled<V: Lanes, const N: usize, const U: usize>(
    source: &[V::Scalar],
    centre: usize,
    stride: usize,
    len: usize,
    taps: &[[V::Scalar; 3]],
    mut out: [&mut [V::Scalar]; N],
) {
    let reach = (taps.len() - 1) * stride;
    let source = &source[centre - reach..];
    let mut at = 0;
    while at < len {
        let mut sums = [[V::zero(); U]; N];
        for u in 0..U {
            sums[0][u] = V::load(&source[reach + at + u * V::LANES..]) * V::splat(taps[0][0]);
        }
        let (mut before, mut after) = (reach + at, reach + at);
        for tap in &taps[1..] {
            before -= stride;
            after += stride;
            let g: [V; N] = std::array::from_fn(|n| V::splat(tap[n]));
            // Cut to a known length, so that one check serves all loads.
            let (left, right) = (&source[before..before + U * V::LANES], &source[after..after + U * V::LANES]);
            for u in 0..U {
                let (a, b) = (V::load(&left[u * V::LANES..]), V::load(&right[u * V::LANES..]));
                let sum = a + b;
                sums[0][u] = sum.mul_add(g[0], sums[0][u]);
                if N > 1 {
                    sums[1][u] = (b - a).mul_add(g[1], sums[1][u]);
                }
                if N > 2 {
                    sums[2][u] = sum.mul_add(g[2], sums[2][u]);
                }
            }
        }
        for (target, sum) in out.iter_mut().zip(&sums) {
            for u in 0..U {
                sum[u].store(&mut target[at + u * V::LANES..]);
            }
        }
        at += U * V::LANES;
    }
}
