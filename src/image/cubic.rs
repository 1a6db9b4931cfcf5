//! Brightness between the pixels by cubic convolution; beyond the border its pixels go on.

use super::Interpolation;
use crate::math::Real;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use crate::types::Frame;

/// Brightness at `(x, y)` px by cubic convolution (R. Keys, 1981); places beyond the border count as on it.
#[inline(always)]
pub fn cubic_at<T: Real>(frame: &Frame<T>, x: f64, y: f64) -> T {
    let (width, height) = frame.size();
    let (x, y) = (x.clamp(0.0, width as f64 - 1.0), y.clamp(0.0, height as f64 - 1.0));
    let (x0, y0) = (x as usize, y as usize);
    let (wx, wy) = (Interpolation::Bicubic.weights(x - x0 as f64), Interpolation::Bicubic.weights(y - y0 as f64));
    let column: [usize; 4] = std::array::from_fn(|i| (x0 + i).saturating_sub(1).min(width - 1));
    let mut sum = 0.0;
    for (j, weight) in wy.iter().enumerate() {
        let row = frame.row((y0 + j).saturating_sub(1).min(height - 1));
        let along: f64 = (0..4).map(|i| wx[i] * row[column[i]].to_f64()).sum();
        sum += weight * along;
    }
    T::from_f64(sum)
}

/// As [`cubic_at`] for every place `(x[i] - origin[0], y[i] - origin[1])`, to `out[i]`.
///
/// Panics when `x` or `y` are shorter than `out`, or when the frame is empty.
pub fn cubic_at_all<T: SimdReal>(
    level: Level,
    frame: &Frame<T>,
    origin: [f64; 2],
    (x, y): (&[T], &[T]),
    out: &mut [T],
) {
    dispatch(level, Places { frame, origin, x, y, out });
}

struct Places<'a, T> {
    frame: &'a Frame<T>,
    origin: [f64; 2],
    x: &'a [T],
    y: &'a [T],
    out: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Places<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let count = self.out.len();
        let (x, y) = (&self.x[..count], &self.y[..count]);
        let mut first = 0;
        while first + V::LANES <= count {
            let places = first..first + V::LANES;
            if self.all_deep(&x[places.clone()], &y[places.clone()]) {
                self.deep(V::load(&x[places.clone()]), V::load(&y[places.clone()])).store(&mut self.out[places]);
            } else {
                places.for_each(|i| self.out[i] = self.single(x[i], y[i]));
            }
            first += V::LANES;
        }
        (first..count).for_each(|i| self.out[i] = self.single(x[i], y[i]));
    }
}

impl<T: SimdReal> Places<'_, T> {
    /// Whether all sixteen pixels around every place are in the frame.
    #[inline(always)]
    fn all_deep(&self, x: &[T], y: &[T]) -> bool {
        let least = self.origin.map(|o| T::from_f64(o + 1.0));
        let most = [self.frame.width(), self.frame.height()];
        let most: [T; 2] = std::array::from_fn(|k| T::from_f64(self.origin[k] + most[k] as f64 - 2.0));
        let deep = |at: T, k: usize| at >= least[k] && at < most[k];
        x.iter().zip(y).all(|(&x, &y)| deep(x, 0) && deep(y, 1))
    }

    /// One vector of places of which [`Self::all_deep`] holds.
    #[inline(always)]
    fn deep<V: Lanes<Scalar = T>>(&self, x: V, y: V) -> V {
        // A place just below a limit may round up to it.
        let last = [self.frame.width(), self.frame.height()].map(|length| V::constant(length as f64 - 3.0));
        let (x, y) = (x - V::constant(self.origin[0]), y - V::constant(self.origin[1]));
        let one = V::constant(1.0);
        let (column, row) = (x.floor().max(one).min(last[0]), y.floor().max(one).min(last[1]));
        let sums = V::sum_patches(self.frame.data(), self.frame.width(), column - one, row - one, weights(y - row));
        let across = weights(x - column);
        let sum = sums[1].mul_add(across[1], sums[0] * across[0]);
        sum + sums[3].mul_add(across[3], sums[2] * across[2])
    }

    fn single(&self, x: T, y: T) -> T {
        cubic_at(self.frame, x.to_f64() - self.origin[0], y.to_f64() - self.origin[1])
    }
}

/// [`Interpolation::weights`] in lanes.
#[inline(always)]
fn weights<V: Lanes>(f: V) -> [V; 4] {
    let number = V::constant;
    let f2 = f * f;
    [
        f.mul_add(number(-0.5), number(1.0)).mul_add(f, number(-0.5)) * f,
        f.mul_add(number(1.5), number(-2.5)).mul_add(f2, number(1.0)),
        f.mul_add(number(-1.5), number(2.0)).mul_add(f, number(0.5)) * f,
        f.mul_add(number(0.5), number(-0.5)) * f2,
    ]
}
