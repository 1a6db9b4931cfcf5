//! Gaussian-weighted moments of planes: separable sums with `g`, `x g` and `x^2 g`.
//!
//! The normal equations of a window need sums of products weighted by `w`, `w x`, `w y`, `w x^2`, `w x y` and
//! `w y^2`, with `w = g(x) g(y)`: three one-dimensional filters down the columns, and along the rows those of
//! each result that are still needed.

use crate::simd::{Lanes, SimdReal};

/// Filters of one axis: `taps[k] = [g, g k/s, g (k/s)^2]` for the distances k = 0 ..= radius, s the unit of
/// length.
#[derive(Debug, Clone)]
pub(super) struct Window<T> {
    pub taps: Vec<[T; 3]>,
}

impl<T: SimdReal> Window<T> {
    /// The Gaussian of `sigma` px cut off at `radius`, normalised to a sum of 1; lengths in units of `sigma`.
    pub fn gaussian(sigma: f64, radius: usize) -> Self {
        Self { taps: cast(&weights(sigma, radius), sigma) }
    }

    /// Squares of the weights with which a window of `sigma` px sees the noise of samples that were smoothed
    /// by a Gaussian of `smooth` px, cut where they are as small as the Gaussian at `radius`.
    ///
    /// `g_sigma(p) g_smooth(q - p)` is `g(q)`, wider by the smoothing, times a kernel about `p = a q`, `a =
    /// sigma^2 / (sigma^2 + smooth^2)`; the weights are those at p, their squares summed over q. Lengths are
    /// in units of `sigma`.
    pub fn squared(sigma: f64, radius: usize, smooth: f64) -> Self {
        let narrow = sigma * sigma / sigma.hypot(smooth);
        let share = (narrow / sigma).powi(2);
        let reach = (radius as f64 / std::f64::consts::SQRT_2 * narrow / sigma).ceil() as usize;
        let g: Vec<f64> = weights(narrow, radius.max(reach)).iter().map(|w| share * w * w).collect();
        Self { taps: cast(&g[..=reach.min(radius)], sigma) }
    }

    /// A smoothing kernel from its weights at distance 0, 1, ...
    pub fn smoothing(half: &[f64]) -> Self {
        Self { taps: cast(half, 1.0) }
    }

    /// Largest distance, px.
    pub fn radius(&self) -> usize {
        self.taps.len() - 1
    }

    /// Sums of `g`, `x g` and `x^2 g` over the part of the axis `from .. to` around `at`.
    pub fn partial(&self, at: usize, from: usize, to: usize) -> [f64; 3] {
        let mut sums = [0.0; 3];
        for (k, tap) in self.taps.iter().enumerate() {
            let [g, g1, g2] = tap.map(crate::math::Real::to_f64);
            let right = (from..to).contains(&(at + k));
            let left = k > 0 && at >= k && (from..to).contains(&(at - k));
            let (sum, difference) = (f64::from(right) + f64::from(left), f64::from(right) - f64::from(left));
            sums[0] += sum * g;
            sums[1] += difference * g1;
            sums[2] += sum * g2;
        }
        sums
    }
}

/// Weights at distance 0 ..= radius of the one-dimensional Gaussian whose full sum is 1.
pub(in crate::flow) fn weights(sigma: f64, radius: usize) -> Vec<f64> {
    let raw: Vec<f64> = (0..=radius).map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp()).collect();
    let sum = raw[0] + 2.0 * raw[1..].iter().rev().sum::<f64>();
    raw.iter().map(|w| w / sum).collect()
}

fn cast<T: SimdReal>(half: &[f64], unit: f64) -> Vec<[T; 3]> {
    half.iter()
        .enumerate()
        .map(|(k, g)| {
            let x = k as f64 / unit;
            [T::from_f64(*g), T::from_f64(g * x), T::from_f64(g * x * x)]
        })
        .collect()
}

/// Row lengths are multiples of this many samples, so that no loop below has a tail.
pub(super) const CHUNK: usize = 32;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{Kernel, Level, dispatch};

    struct Once<'a>(&'a [f64], &'a [[f64; 3]], usize, [&'a mut [f64]; 3]);
    impl Kernel<f64> for Once<'_> {
        type Output = ();
        #[inline(always)]
        fn run<V: Lanes<Scalar = f64>>(self) {
            filter::<V, 3>(self.0, self.2, 2, CHUNK, self.1, self.3);
        }
    }

    #[test]
    fn filters_are_the_three_moments_at_every_level() {
        let window = Window::<f64>::gaussian(1.5, 4);
        let source: Vec<f64> = (0..CHUNK + 16).map(|i| ((i * i) as f64).sin()).collect();
        for level in Level::available() {
            let (mut a, mut b, mut c) = (vec![0.0; CHUNK], vec![0.0; CHUNK], vec![0.0; CHUNK]);
            dispatch(level, Once(&source, &window.taps, 8, [&mut a, &mut b, &mut c]));
            for i in 0..CHUNK {
                let mut want = [0.0; 3];
                for k in -4i32..=4 {
                    let (z, x) = (source[(8 + i as i32 + 2 * k) as usize], f64::from(k) / 1.5);
                    let g = window.taps[k.unsigned_abs() as usize][0];
                    want = [want[0] + g * z, want[1] + g * x * z, want[2] + g * x * x * z];
                }
                for (got, want) in [a[i], b[i], c[i]].iter().zip(want) {
                    assert!((got - want).abs() < 1e-13, "{level:?}");
                }
            }
        }
    }

    #[test]
    fn partial_sums_are_those_of_the_taps_inside() {
        let window = Window::<f64>::gaussian(2.0, 6);
        let whole = window.partial(20, 0, 100);
        assert!((whole[0] - 1.0).abs() < 1e-14 && whole[1].abs() < 1e-15 && whole[2] > 0.9 && whole[2] < 1.0);
        let edge = window.partial(1, 1, 100);
        assert!((edge[0] - 0.5 - 0.5 * window.taps[0][0]).abs() < 1e-14 && edge[1] > 0.0);
    }
}
