//! From the places of the covariance to pixels.

use super::super::grid::Planes;
use super::super::refine::{PITCH, SPACING};
use super::Entries;
use crate::flow::windowed::solve::{ENTRIES, upper};
use crate::simd::SimdReal;

/// Pixels of the level of the estimate from one place to the next.
const STEP: usize = SPACING * PITCH as usize;

/// A covariance that is linear between places, hence positive definite where theirs is.
#[derive(Debug, Default)]
pub(in crate::flow::coarse_to_fine) struct Spread<T> {
    planes: Planes<T>,
    /// Pixels from one place to the next.
    step: usize,
}

impl<T: SimdReal> Spread<T> {
    /// Of `size` places, row by row, of the given level of the pyramid: flow in pixels of the frame is so many times larger, slopes are the same.
    pub(super) fn new(places: &[Entries], size: (usize, usize), level: usize) -> Self {
        let factor = f64::from(1 << level as u32);
        let mut scale = [0.0; ENTRIES];
        for (i, j) in (0..6).flat_map(|i| (i..6).map(move |j| (i, j))) {
            scale[upper(i, j)] = factor.powi(i32::from(i < 2) + i32::from(j < 2));
        }
        let mut planes = Planes::new(size.0, size.1, ENTRIES);
        for (y, row) in places.chunks_exact(size.0.max(1)).enumerate() {
            for k in 0..ENTRIES {
                let line = planes.line_mut(k, y);
                line.iter_mut().zip(row).for_each(|(out, place)| *out = T::from_f64(scale[k] * place[k]));
            }
        }
        Self { planes, step: STEP << level }
    }

    /// The places above and below row `y` and the share of the lower ones.
    fn rows(&self, y: usize) -> (usize, usize, f64) {
        let last = self.planes.height - 1;
        let step = self.step;
        ((y / step).min(last), (y / step + 1).min(last), (y % step) as f64 / step as f64)
    }

    /// Entry `k` at a pixel.
    pub fn at(&self, k: usize, (x, y): (usize, usize)) -> T {
        let (above, below, share) = self.rows(y);
        let last = self.planes.width - 1;
        let (left, right) = ((x / self.step).min(last), (x / self.step + 1).min(last));
        let across = (x % self.step) as f64 / self.step as f64;
        let row = |y: usize| {
            let (a, b) = (self.planes.at(k, left, y).to_f64(), self.planes.at(k, right, y).to_f64());
            a + (b - a) * across
        };
        T::from_f64(row(above) + (row(below) - row(above)) * share)
    }

    /// Entry `k` along row `y`, to the end of `out`; `places` is memory to work in.
    pub fn row(&self, k: usize, y: usize, places: &mut Vec<T>, out: &mut [T]) {
        let (above, below, share) = self.rows(y);
        let share = T::from_f64(share);
        places.clear();
        let (upper, lower) = (self.planes.line(k, above), self.planes.line(k, below));
        places.extend(upper.iter().zip(lower).map(|(&a, &b)| a + (b - a) * share));
        places.extend(places.last().copied());
        let share = T::from_f64(1.0 / self.step as f64);
        for (pair, out) in places.windows(2).zip(out.chunks_mut(self.step)) {
            let (first, rise) = (pair[0], (pair[1] - pair[0]) * share);
            for (i, out) in out.iter_mut().enumerate() {
                *out = first + rise * T::from_f64(i as f64);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_what_single_pixels_are() {
        let places: Vec<Entries> = (0..6).map(|n| std::array::from_fn(|k| ((n * n + 3 * k) as f64).cos())).collect();
        let spread = Spread::<f64>::new(&places, (3, 2), 0);
        let (mut memory, mut row) = (Vec::new(), [0.0; 22]);
        for y in 0..15 {
            for k in 0..ENTRIES {
                spread.row(k, y, &mut memory, &mut row);
                for (x, value) in row.iter().enumerate() {
                    assert!((value - spread.at(k, (x, y))).abs() < 1e-12, "{k} {x} {y}");
                }
            }
        }
        assert!((spread.at(0, (4, 0)) - 0.5 * (places[0][0] + places[1][0])).abs() < 1e-12);
        assert_eq!(spread.at(5, (21, 14)), places[5][5]);
    }
}
