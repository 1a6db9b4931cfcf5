//! Two motions between the same frames: each site takes the one that explains them better.

use super::data::{COUNT, DataOptions, DataTerm, ERROR, MOTION, Pool, VALID};
use super::grid::Planes;
use super::levels::{Compared, PyramidLevel};
use super::memory::Space;
use crate::math::median;
use crate::simd::{Level, SimdReal};

/// A motion must leave so many times less of the frames than the one that it replaces, what is usually left
/// added to both: less is chance.
const ADVANTAGE: f64 = 1.1;
/// Where less of a window than this is seen, less than in a corner of the frame, what a motion leaves there
/// tells nothing.
const LEAST_SEEN: f64 = 0.1;

/// What motions are compared by.
pub(super) struct Comparison<'a, T> {
    pub simd: Level,
    /// The level whose sites the motions are on.
    pub level: &'a PyramidLevel<T>,
    /// Its frames that are compared.
    pub compared: Compared,
    /// Standard deviation of the residual.
    pub scale: Option<T>,
    pub pool: &'a Pool<T>,
    pub space: &'a Space<T>,
}

impl<T: SimdReal> Comparison<'_, T> {
    /// Lets `other` replace the `motion` where it is further from it than `apart`, px of the level, and
    /// explains the frames better; beside such sites both are blended. Whether there are such sites.
    pub fn take_better(&self, motion: &mut Planes<T>, other: &Planes<T>, apart: f64) -> bool {
        let (known, found) = (self.left(motion), self.left(other));
        let mut sorted: Vec<f64> = known.iter().copied().filter(|left| !left.is_nan()).collect();
        let usual = median(&mut sorted).unwrap_or(0.0);
        let size = (motion.width, motion.height);
        let distance = |n: usize| {
            let [u, v] =
                [0, 1].map(|k| (motion.at(k, n % size.0, n / size.0) - other.at(k, n % size.0, n / size.0)).to_f64());
            u.hypot(v)
        };
        // Comparisons with what is not known are false.
        let better = |n: usize| ADVANTAGE * (found[n] + usual) < known[n] + usual && distance(n) > apart;
        let wins: Vec<bool> = (0..known.len()).map(better).collect();
        if !wins.contains(&true) {
            return false;
        }
        for (x, y) in (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y))) {
            let share = share_around(&wins, size, (x, y));
            if share > 0.0 {
                for k in 0..MOTION {
                    let value = &mut motion.line_mut(k, y)[x];
                    *value += T::from_f64(share) * (other.at(k, x, y) - *value);
                }
            }
        }
        true
    }

    /// The residual energy that a motion leaves around each site, grey^2, row by row; NaN where too little is
    /// seen.
    fn left(&self, motion: &Planes<T>) -> Vec<f64> {
        let mut data = self.space.planes(motion.width, motion.height, COUNT);
        let term = DataTerm::new(self.simd, DataOptions::default(), self.pool);
        term.linearise(self.level.size, &self.level.views(self.compared), motion, self.scale, &mut data);
        let energy = |(error, seen): (&T, &T)| {
            let seen = seen.to_f64();
            if seen >= LEAST_SEEN { error.to_f64() / seen } else { f64::NAN }
        };
        let rows = (0..data.height).flat_map(|y| data.line(ERROR, y).iter().zip(data.line(VALID, y)));
        let left = rows.map(energy).collect();
        self.space.keep_small(data);
        left
    }
}

/// The share of sites around one that win, by their nearness: half the weight along each axis is its own.
fn share_around(wins: &[bool], (width, height): (usize, usize), (x, y): (usize, usize)) -> f64 {
    let near = |at: usize, len: usize| [(at.saturating_sub(1), 0.25), (at, 0.5), ((at + 1).min(len - 1), 0.25)];
    let mut share = 0.0;
    for (j, across) in near(y, height) {
        for (i, along) in near(x, width) {
            if wins[j * width + i] {
                share += across * along;
            }
        }
    }
    share
}

#[cfg(test)]
mod tests {
    use super::super::levels::Pyramid;
    use super::super::range::Range;
    use super::*;
    use crate::types::Frame;

    #[test]
    fn each_site_takes_what_explains_its_frames() {
        // The right half moves by one px, the left stays.
        let texture = |x: f32, y: f32| (0.7 * x + 0.2 * y).sin() + (0.3 * x - 0.6 * y).cos();
        let [before, after] = [0.0, 1.0].map(|t| {
            Frame::from_fn(64, 48, |x, y| {
                let (x, y) = (x as f32, y as f32);
                if x < 32.0 { texture(x, y) } else { texture(x - t, y) }
            })
        });
        let mut pyramid = Pyramid::default();
        let range = Range { mean: 0.0, gain: 1.0, contrast: 1.0 };
        pyramid.fill(Level::SCALAR, &[&before, &after], range, None, (Some(1), 0));
        let (pool, space) = (Pool::default(), Space::default());
        let (level, compared) = (&pyramid.levels()[0], Compared::All);
        let comparison = Comparison { simd: Level::SCALAR, level, compared, scale: None, pool: &pool, space: &space };
        let still = Planes::<f32>::new(32, 24, MOTION);
        let mut moved = still.clone();
        (0..24).for_each(|y| moved.line_mut(0, y).fill(1.0));
        for (mut motion, other) in [(still.clone(), &moved), (moved.clone(), &still)] {
            assert!(comparison.take_better(&mut motion, other, 0.9));
            for y in 0..24 {
                let u = motion.line(0, y);
                assert!(u[2..12].iter().all(|u| *u == 0.0) && u[20..].iter().all(|u| *u == 1.0), "{y}: {u:?}");
            }
        }
        // (Along the left edge nothing is seen of what is said to have come from outside.) Nothing is better
        // than itself, or than what is as near as that.
        for (other, apart) in [(&moved, 0.0), (&still, 1.0)] {
            let mut same = moved.clone();
            assert!(!comparison.take_better(&mut same, other, apart));
            assert_eq!(same.data(), moved.data());
        }
    }

    #[test]
    fn shares_count_neighbours_once() {
        let mut wins = vec![false; 12];
        wins[5] = true;
        let share = |x, y| share_around(&wins, (4, 3), (x, y));
        assert_eq!([share(1, 1), share(0, 1), share(2, 2), share(3, 1)], [0.25, 0.125, 0.0625, 0.0]);
        assert_eq!(share_around(&[true], (1, 1), (0, 0)), 1.0);
    }
}
