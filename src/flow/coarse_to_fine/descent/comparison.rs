//! Compares two motions between the same frames; each site takes the one with less residual energy.

use crate::flow::coarse_to_fine::data_term::{
    COUNT, DataOptions, DataTerm, ERROR, MIN_USABLE_SHARE, MOTION, Pool, Sums, VALID,
};
use crate::flow::coarse_to_fine::plane_pool::PlanePool;
use crate::flow::coarse_to_fine::planes::Planes;
use crate::flow::coarse_to_fine::pyramid::{ComparedFrames, PyramidLevel};
use crate::math::median;
use crate::simd::{Level, SimdReal};

/// Minimum ratio of residual energies, the typical energy added to both: smaller differences are chance.
const MIN_ENERGY_RATIO: f64 = 1.1;

pub(in crate::flow::coarse_to_fine) struct Comparison<'a, T> {
    pub simd: Level,
    /// Level whose sites the motions are on.
    pub level: &'a PyramidLevel<T>,
    pub compared: ComparedFrames,
    /// Standard deviation of the residual, grey levels.
    pub residual_std: Option<T>,
    /// Whether sites that cannot be compared along `other` take it if most of the others do.
    pub follows_majority: bool,
    pub pool: &'a Pool<T>,
    pub space: &'a PlanePool<T>,
}

impl<T: SimdReal> Comparison<'_, T> {
    /// Replaces `motion` by `other` where that is better ([`Comparison::better_sites`]), blended beside such
    /// sites. Returns whether there are any.
    pub fn replace_where_better(&self, motion: &mut Planes<T>, other: &Planes<T>, min_distance: f64) -> bool {
        let wins = self.better_sites(motion, other, min_distance, |_| false);
        replace(motion, other, &wins);
        wins.contains(&true)
    }

    /// Whether both differ by more than `min_distance`, px of the level, and `other` has less residual
    /// energy, row by row; or whether `other` is `preferred` and can be compared with the frames.
    pub fn better_sites(
        &self,
        motion: &Planes<T>,
        other: &Planes<T>,
        min_distance: f64,
        preferred: impl Fn(usize) -> bool,
    ) -> Vec<bool> {
        let (known, found) = (self.residual_energies(motion), self.residual_energies(other));
        let mut sorted: Vec<f64> = known.iter().copied().filter(|energy| !energy.is_nan()).collect();
        let typical = median(&mut sorted).unwrap_or(0.0);
        let width = motion.width;
        let distance = |n: usize| {
            let [u, v] =
                [0, 1].map(|k| (motion.at(k, n % width, n / width) - other.at(k, n % width, n / width)).to_f64());
            u.hypot(v)
        };
        // Comparisons with NaN are false.
        let better =
            |n: usize| MIN_ENERGY_RATIO * (found[n] + typical) < known[n] + typical && distance(n) > min_distance;
        let is_preferred = |n: usize| preferred(n) && !found[n].is_nan();
        let mut wins: Vec<bool> = (0..known.len()).map(|n| is_preferred(n) || better(n)).collect();
        let compared = known.iter().zip(&found).filter(|(a, b)| !a.is_nan() && !b.is_nan()).count();
        if self.follows_majority && 2 * wins.iter().filter(|&&win| win).count() > compared {
            wins.iter_mut().zip(&found).for_each(|(win, energy)| *win |= energy.is_nan());
        }
        wins
    }

    /// Residual energy of a motion around each site, grey^2, row by row; NaN where too little is usable.
    fn residual_energies(&self, motion: &Planes<T>) -> Vec<f64> {
        let mut data = self.space.planes(motion.width, motion.height, COUNT);
        let term = DataTerm::new(self.simd, DataOptions::default(), self.pool);
        let views = self.level.views(self.compared);
        term.linearise(Sums::Moments, (self.level.size, &views), motion, self.residual_std, &mut data);
        let energy = |(error, usable): (&T, &T)| {
            let usable = usable.to_f64();
            if usable >= MIN_USABLE_SHARE { error.to_f64() / usable } else { f64::NAN }
        };
        let rows = (0..data.height).flat_map(|y| data.line(ERROR, y).iter().zip(data.line(VALID, y)));
        let mut residual_energies = Vec::with_capacity(data.width * data.height);
        residual_energies.extend(rows.map(energy));
        self.space.keep(data);
        residual_energies
    }
}

/// Replaces `motion` by `other` at the sites that win, blended beside them.
pub(in crate::flow::coarse_to_fine) fn replace<T: SimdReal>(motion: &mut Planes<T>, other: &Planes<T>, wins: &[bool]) {
    if !wins.contains(&true) {
        return;
    }
    let size = (motion.width, motion.height);
    for (x, y) in (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y))) {
        let share = share_around(wins, size, (x, y));
        if share > 0.0 {
            for k in 0..MOTION {
                let value = &mut motion.line_mut(k, y)[x];
                *value += T::from_f64(share) * (other.at(k, x, y) - *value);
            }
        }
    }
}

/// Weighted share of winning sites around one; half of the weight along each axis is its own.
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
