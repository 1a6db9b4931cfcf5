//! Brightness between the pixels as a cubic spline: exact at the pixels, twice differentiable.

mod prefilter;

use crate::parallel::for_each_band;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use crate::types::Frame;

/// Coefficients before the first column and row, so that the first pixel's taps exist.
const BEFORE: usize = 1;
/// Coefficients before and after together: the last pixel's taps reach two further.
const MARGIN: usize = BEFORE + 2;

/// Weights of the smoothing filter, of a standard deviation of 1 px.
const BINOMIAL: [f64; 2 * REACH + 1] = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];
const REACH: usize = 2;

/// The cubic spline through the samples of a frame, which it continues by mirroring at the outermost pixel
/// centres (M. Unser, "Splines: a perfect fit for signal and image processing", 1999).
///
/// `f(x, y) = sum_j sum_i c_ij b(x - i) b(y - j)` with the cubic B-spline `b`; the coefficients `c` are such
/// that `f` meets every sample. Samples must be finite: any other spreads along its column and row.
#[derive(Debug, Clone)]
pub struct Spline<T> {
    width: usize,
    height: usize,
    /// Values a row.
    stride: usize,
    /// `height + MARGIN` rows; pixel (0, 0) is at (BEFORE, BEFORE).
    coefficients: Vec<T>,
}

impl<T> Default for Spline<T> {
    /// That of an empty frame.
    fn default() -> Self {
        Self { width: 0, height: 0, stride: 0, coefficients: Vec::new() }
    }
}

impl<T: SimdReal> Spline<T> {
    /// The spline through the samples of `frame`; identical for any number of threads.
    pub fn new(level: Level, frame: &Frame<T>) -> Self {
        let mut spline = Self::default();
        spline.refill(level, frame);
        spline
    }

    /// The spline through the samples of another frame, in the same memory when it is of the same size.
    pub fn refill(&mut self, level: Level, frame: &Frame<T>) {
        let (width, height) = frame.size();
        if (width, height) != self.size() {
            (self.width, self.height) = (width, height);
            self.stride = stride::<T>(width);
            let rows = if frame.data().is_empty() { 0 } else { height + MARGIN };
            self.coefficients.clear();
            self.coefficients.resize(rows * self.stride, T::from_f64(0.0));
        }
        prefilter::prefilter(level, frame, self.stride, &mut self.coefficients);
    }

    /// Number of values that it holds in memory.
    pub fn values(&self) -> usize {
        self.coefficients.len()
    }

    /// The spline of the frame smoothed by `[1, 4, 6, 4, 1] / 16` along both axes, in `memory` of
    /// at least [`Spline::values`].
    pub fn smoothed(&self, level: Level, mut memory: Vec<T>) -> Self {
        let rows = self.values().checked_div(self.stride).unwrap_or(0);
        for_each_band(&mut memory[..self.values()], self.stride, |_, band, out| {
            let mut column = vec![T::from_f64(0.0); self.stride + 2 * REACH];
            for (y, out) in band.zip(out.chunks_exact_mut(self.stride)) {
                let around: [&[T]; 2 * REACH + 1] = std::array::from_fn(|k| {
                    let row = (y + k).saturating_sub(REACH).min(rows - 1);
                    &self.coefficients[row * self.stride..][..self.stride]
                });
                dispatch(level, SmoothRow { around, column: &mut column, out });
            }
        });
        Self { coefficients: memory, ..*self }
    }

    /// Its memory, for another.
    pub fn into_memory(self) -> Vec<T> {
        self.coefficients
    }

    /// `(width, height)` of the frame.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// `out[i] = f(x[i], y[i])`, positions in px; those outside are moved to the nearest edge, NaN to the
    /// first pixel's. All NaN for an empty frame.
    ///
    /// Panics when `x` or `y` are shorter than `out`.
    pub fn sample_row(&self, level: Level, x: &[T], y: &[T], out: &mut [T]) {
        dispatch(level, SampleRow { spline: self, x, y, out });
    }

    /// As [`Spline::sample_row`], for use inside another kernel.
    #[inline(always)]
    pub(crate) fn sample_row_in<V: Lanes<Scalar = T>>(&self, x: &[T], y: &[T], out: &mut [T]) {
        let count = out.len();
        let (x, y) = (&x[..count], &y[..count]);
        if self.coefficients.is_empty() {
            out.fill(T::nan());
            return;
        }
        if count < V::LANES {
            for i in 0..count {
                out[i] = self.sample_in::<T>(x[i], y[i]);
            }
            return;
        }
        let mut i = 0;
        while i < count {
            // The last vector overlaps the one before.
            i = i.min(count - V::LANES);
            self.sample_in(V::load(&x[i..]), V::load(&y[i..])).store(&mut out[i..]);
            i += V::LANES;
        }
    }

    /// `f(x, y)` in lanes; the frame is not empty.
    #[inline(always)]
    pub(crate) fn sample_in<V: Lanes<Scalar = T>>(&self, x: V, y: V) -> V {
        let (x, y) = (clamp(x, self.width), clamp(y, self.height));
        let (column, row) = (x.floor(), y.floor());
        // The first tap of pixel (0, 0) lies one further up and left, which the margin makes up for.
        let down = weights(y - row);
        let sums = V::sum_patches(&self.coefficients, self.stride, column, row, down);
        let across = weights(x - column);
        let sum = sums[1].mul_add(across[1], sums[0] * across[0]);
        sum + sums[3].mul_add(across[3], sums[2] * across[2])
    }
}

/// Values a row: the margin, in whole cache lines but not whole pages, whose columns would conflict.
fn stride<T>(width: usize) -> usize {
    let (line, page) = (64 / size_of::<T>(), 4096 / size_of::<T>());
    let stride = (width + MARGIN).next_multiple_of(line);
    if stride.is_multiple_of(page) { stride + line } else { stride }
}

/// `position` moved into `0..=len - 1`; NaN becomes 0.
#[inline(always)]
fn clamp<V: Lanes>(position: V, len: usize) -> V {
    position.max(V::zero()).min(V::constant(len as f64 - 1.0))
}

/// The cubic B-spline at `f + 1`, `f`, `1 - f`, `2 - f`: weights at -1, 0, 1, 2 for a position `f`.
#[inline(always)]
fn weights<V: Lanes>(f: V) -> [V; 4] {
    let (sixth, half, two_thirds) = (V::constant(1.0 / 6.0), V::constant(0.5), V::constant(2.0 / 3.0));
    let g = V::constant(1.0) - f;
    let (f2, g2) = (f * f, g * g);
    [
        g2 * g * sixth,
        f.mul_add(half, V::constant(-1.0)).mul_add(f2, two_thirds),
        g.mul_add(half, V::constant(-1.0)).mul_add(g2, two_thirds),
        f2 * f * sixth,
    ]
}

/// One row of a smoothed spline's coefficients, the outermost repeated.
struct SmoothRow<'a, T> {
    around: [&'a [T]; 2 * REACH + 1],
    /// Scratch memory: the row smoothed down the columns, with its margins.
    column: &'a mut [T],
    out: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for SmoothRow<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { around: [a, b, c, d, e], column, out } = self;
        let n = out.len();
        let [outer, inner, centre] = [0, 1, 2].map(|k| T::from_f64(BINOMIAL[k]));
        let (a, b, c, d, e) = (&a[..n], &b[..n], &c[..n], &d[..n], &e[..n]);
        let middle = &mut column[REACH..REACH + n];
        for i in 0..n {
            middle[i] = outer * (a[i] + e[i]) + inner * (b[i] + d[i]) + centre * c[i];
        }
        let (first, last) = (middle[0], middle[n - 1]);
        column[..REACH].fill(first);
        column[REACH + n..].fill(last);
        let column = &column[..n + 2 * REACH];
        for i in 0..n {
            out[i] =
                outer * (column[i] + column[i + 4]) + inner * (column[i + 1] + column[i + 3]) + centre * column[i + 2];
        }
    }
}

struct SampleRow<'a, T> {
    spline: &'a Spline<T>,
    x: &'a [T],
    y: &'a [T],
    out: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for SampleRow<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        self.spline.sample_row_in::<V>(self.x, self.y, self.out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smoothed_spline_meets_smoothed_samples() {
        let simd = Level::detect();
        let frame = Frame::<f64>::from_fn(23, 17, |x, y| ((x * x + 7 * y) as f64 * 0.37).sin());
        let spline = Spline::new(simd, &frame);
        let smoothed = spline.smoothed(simd, vec![0.0; spline.values() + 5]);
        for (x, y) in (6..17).flat_map(|x| (6..11).map(move |y| (x, y))) {
            let near = |k: usize| (0..=2 * REACH).map(move |i| (k + i - REACH, BINOMIAL[i]));
            let rows = near(y).map(|(j, down)| down * near(x).map(|(i, w)| w * frame.get(i, j)).sum::<f64>());
            let mut found = [0.0];
            smoothed.sample_row(simd, &[x as f64], &[y as f64], &mut found);
            assert!((found[0] - rows.sum::<f64>()).abs() < 1e-12, "{x} {y}");
        }
    }
}
