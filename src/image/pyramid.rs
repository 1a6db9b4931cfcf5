//! Frames and masks of half the size, for estimators that go from coarse to fine.

use super::{GaussianSmoother, blocks::cover, blocks::load, blocks::store};
use crate::parallel::for_each_band;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use crate::types::{Frame, Mask};

/// Taps on each side of the centre.
const RADIUS: usize = 3;

/// `(width, height)` of a halved frame: pixel `i` of the result lies at pixel `2 i`.
pub fn halved_size((width, height): (usize, usize)) -> (usize, usize) {
    (width.div_ceil(2), height.div_ceil(2))
}

/// What halving leaves of the variance of white noise.
pub fn halved_noise() -> f64 {
    taps().iter().map(|w| w * w).sum::<f64>().powi(2)
}

/// Weights of the smoothing before a frame is halved, at distances -3 to 3.
fn taps() -> Vec<f64> {
    GaussianSmoother { sigma: 1.0, truncate: RADIUS as f64, border: super::Border::Replicate }.kernel()
}

/// The frame smoothed by a Gaussian of 1 px, at every second pixel: `out(x, y) = sum_j sum_i w_i w_j in(2 x +
/// i, 2 y + j)`, `w_i = exp(-i^2 / 2) / sum`, `|i| <= 3`, the border replicated: one step of the pyramid of
/// P. J. Burt and E. H. Adelson, "The Laplacian pyramid as a compact image code", 1983, with sampled Gaussian
/// weights.
///
/// Each result is a direct sum: a NaN damages only the pixels whose kernel reaches it.
pub fn halve<T: SimdReal>(level: Level, frame: &Frame<T>) -> Frame<T> {
    let mut out = Frame::default();
    halve_into(level, frame, &mut out);
    out
}

/// As [`halve`], into a frame that is made anew only when it is of another size.
pub fn halve_into<T: SimdReal>(level: Level, frame: &Frame<T>, out: &mut Frame<T>) {
    let (width, height) = halved_size(frame.size());
    if out.size() != (width, height) {
        *out = Frame::filled(width, height, T::from_f64(0.0));
    }
    if frame.data().is_empty() {
        return;
    }
    let taps = taps();
    let half = std::array::from_fn(|k| T::from_f64(taps[RADIUS + k]));
    for_each_band(out.data_mut(), width, |_, rows, output| {
        dispatch(level, Band { frame, half, first_row: rows.start, output });
    });
}

struct Band<'a, T> {
    frame: &'a Frame<T>,
    /// Weights of the taps at distance 0, 1, 2, 3.
    half: [T; RADIUS + 1],
    first_row: usize,
    output: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Band<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        if self.frame.width().div_ceil(2) < V::LANES { self.rows::<T>() } else { self.rows::<V>() }
    }
}

impl<T: SimdReal> Band<'_, T> {
    #[inline(always)]
    fn rows<V: Lanes<Scalar = T>>(self) {
        let Self { frame, half, first_row, output } = self;
        let (width, last_row) = (frame.width(), frame.height() - 1);
        let count = width.div_ceil(2);
        let weights = half.map(V::splat);
        // The replicated border reaches from column -4 to the second column after the last result's own.
        let mut down = vec![T::from_f64(0.0); 4 + 2 * count + 2];
        let mut even = vec![T::from_f64(0.0); count + 3];
        let mut odd = even.clone();
        for (offset, out) in output.chunks_exact_mut(count).enumerate() {
            let y = 2 * (first_row + offset);
            let row = |dy: usize| frame.row((y + dy).saturating_sub(RADIUS).min(last_row));
            let sources: [&[T]; 2 * RADIUS + 1] = std::array::from_fn(row);
            cover!(width, V, |x, N| sum_down::<V, N>(&sources, x, &weights).store_at(&mut down[4 + x..]));
            let (first, last) = (down[4], down[3 + width]);
            down[..4].fill(first);
            down[4 + width..].fill(last);
            for ((pair, even), odd) in down.chunks_exact(2).zip(&mut even).zip(&mut odd) {
                (*even, *odd) = (pair[0], pair[1]);
            }
            cover!(count, V, |x, N| sum_along::<V, N>(&even, &odd, x, &weights).store_at(&mut out[x..]));
        }
    }
}

/// So that blocks read in the order in which they are made.
trait StoreAt<S> {
    fn store_at(&self, target: &mut [S]);
}

impl<V: Lanes, const N: usize> StoreAt<V::Scalar> for [V; N] {
    #[inline(always)]
    fn store_at(&self, target: &mut [V::Scalar]) {
        store(self, target);
    }
}

/// Seven rows summed down from column `x` on.
#[inline(always)]
fn sum_down<V: Lanes, const N: usize>(rows: &[&[V::Scalar]; 2 * RADIUS + 1], x: usize, weights: &[V]) -> [V; N] {
    let mut sums = load::<V, N>(&rows[RADIUS][x..]).map(|c| c * weights[0]);
    for k in 1..=RADIUS {
        let (above, below) = (load::<V, N>(&rows[RADIUS - k][x..]), load::<V, N>(&rows[RADIUS + k][x..]));
        for i in 0..N {
            sums[i] = (above[i] + below[i]).mul_add(weights[k], sums[i]);
        }
    }
    sums
}

/// Seven neighbours summed along, from `x` on: result 0 lies at `even[2]`, which `odd[2]` follows.
#[inline(always)]
fn sum_along<V: Lanes, const N: usize>(even: &[V::Scalar], odd: &[V::Scalar], x: usize, weights: &[V]) -> [V; N] {
    let pairs = [(odd, 1, 2), (even, 1, 3), (odd, 0, 3)];
    let mut sums = load::<V, N>(&even[x + 2..]).map(|c| c * weights[0]);
    for (k, (values, left, right)) in pairs.into_iter().enumerate() {
        let (left, right) = (load::<V, N>(&values[x + left..]), load::<V, N>(&values[x + right..]));
        for i in 0..N {
            sums[i] = (left[i] + right[i]).mul_add(weights[k + 1], sums[i]);
        }
    }
    sums
}

/// The mask that belongs to a halved frame: a pixel may be used when at least half of the pixels around `(2
/// x, 2 y)` may, weighted 1-2-1 along both axes, the border replicated.
pub fn halve_mask(mask: &Mask) -> Mask {
    let (width, height) = mask.size();
    let (out_width, out_height) = halved_size((width, height));
    let mut out = Frame::filled(out_width, out_height, false);
    if mask.data().is_empty() {
        return out;
    }
    for_each_band(out.data_mut(), out_width, |_, rows, output| {
        // Columns -1 to 2 out_width - 1.
        let mut down = vec![0u8; 2 * out_width + 1];
        for (y, out) in rows.zip(output.chunks_exact_mut(out_width)) {
            let (above, middle) = (mask.row((2 * y).saturating_sub(1)), mask.row(2 * y));
            let below = mask.row((2 * y + 1).min(height - 1));
            for (x, sum) in down[1..=width].iter_mut().enumerate() {
                *sum = u8::from(above[x]) + 2 * u8::from(middle[x]) + u8::from(below[x]);
            }
            down[0] = down[1];
            let last = down[width];
            down[width + 1..].fill(last);
            for (x, out) in out.iter_mut().enumerate() {
                *out = down[2 * x] + 2 * down[2 * x + 1] + down[2 * x + 2] >= 8;
            }
        }
    });
    out
}
