//! From the places of the covariance to pixels.

use super::super::grid::Planes;
use super::super::refine::{PITCH, SPACING};
use super::Entries;
use crate::flow::windowed::solve::ENTRIES;
use crate::simd::SimdReal;

/// Pixels from one place to the next.
const STEP: usize = SPACING * PITCH as usize;

/// A covariance that is linear between places, hence positive definite where theirs is.
#[derive(Debug, Default)]
pub(in crate::flow::coarse_to_fine) struct Spread<T> {
    planes: Planes<T>,
}

impl<T: SimdReal> Spread<T> {
    /// Of `size` places, row by row.
    pub(super) fn new(places: &[Entries], size: (usize, usize)) -> Self {
        let mut planes = Planes::new(size.0, size.1, ENTRIES);
        for (y, row) in places.chunks_exact(size.0.max(1)).enumerate() {
            for k in 0..ENTRIES {
                let line = planes.line_mut(k, y);
                line.iter_mut().zip(row).for_each(|(out, place)| *out = T::from_f64(place[k]));
            }
        }
        Self { planes }
    }

    /// The places above and below row `y` and the share of the lower ones.
    fn rows(&self, y: usize) -> (usize, usize, f64) {
        let last = self.planes.height - 1;
        ((y / STEP).min(last), (y / STEP + 1).min(last), (y % STEP) as f64 / STEP as f64)
    }

    /// Entry `k` at a pixel.
    pub fn at(&self, k: usize, (x, y): (usize, usize)) -> T {
        let (above, below, share) = self.rows(y);
        let last = self.planes.width - 1;
        let (left, right) = ((x / STEP).min(last), (x / STEP + 1).min(last));
        let across = (x % STEP) as f64 / STEP as f64;
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
        let shares: [T; STEP] = std::array::from_fn(|i| T::from_f64(i as f64 / STEP as f64));
        for (pair, out) in places.windows(2).zip(out.chunks_mut(STEP)) {
            let (first, rise) = (pair[0], pair[1] - pair[0]);
            for (out, share) in out.iter_mut().zip(shares) {
                *out = first + rise * share;
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
        let spread = Spread::<f64>::new(&places, (3, 2));
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
