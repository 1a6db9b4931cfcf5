//! One iteration: a linearisation, and the motion that follows from it.

use super::candidates::Comparison;
use super::couple::{CoupleScratch, Coupling, couple};
use super::data::{DataTerm, MOTION, Pool};
use super::descend::Plan;
use super::grid::Planes;
use super::levels::{Compared, PyramidLevel};
use super::memory::Space;
use super::resample::rederive;
use crate::math::robust_std;
use crate::simd::SimdReal;
use std::ops::Range;

/// Noise is taken for at least this share of the brightness' standard deviation.
const LEAST_NOISE: f64 = 1e-3;
/// The scale of the robust weights is at least this share of the brightness' standard deviation.
const LEAST_SCALE: f64 = 4e-3;

/// A site that an iteration moves further than this is on its way, px of the level.
const FAR: f64 = 0.1;
/// So many of those may be an object that is too small to be felt in the mean over the frame.
const OBJECT: usize = 4;
/// SamplingGrid along the edge that do not count, at least and at most: what leaves the frame there may drift for
/// ever, and leads the further the more sites there are.
const RIM: (usize, usize) = (2, 4);
/// A sixteenth of the sites, within those bounds.
const RIM_SHARE: usize = 16;

/// Iterations with loose bonds, and these: each site follows its own data. A small object that moves before a
/// still ground is held back by the usual ones, but the ground could not be told as well.
const LOOSE: (usize, Coupling) = (3, Coupling { flow: 1.0, jacobian: 100.0, break_at: 0.1, sweeps: 4, reweigh: 2 });
/// What they find is another motion when it is further away than this, px of the level; nearer, it is the
/// same with more noise.
const ANOTHER: f64 = 0.5;
/// Where the first of them moves no site by this much, none is on its way to another motion, px of the level.
const LEAVING: f64 = 0.25;
/// Iterations that join both motions.
const JOINED: usize = 2;

/// One linearisation, and the motion that follows from it.
pub(super) struct Step<'a, T> {
    pub plan: &'a Plan,
    pub compared: Compared,
    pub term: DataTerm<'a, T>,
    pub data: &'a mut Planes<T>,
    pub scratch: &'a mut CoupleScratch<T>,
    /// Standard deviation of what brightness changes by along the motion, from the iteration before.
    pub scale: Option<T>,
}

impl<T: SimdReal> Step<'_, T> {
    /// Iterates once; the motion before is the `old` one afterwards.
    pub fn advance(
        &mut self,
        level: &PyramidLevel<T>,
        coupling: &Coupling,
        (motion, old): (&mut Planes<T>, &mut Planes<T>),
    ) -> f64 {
        std::mem::swap(motion, old);
        rederive(old, motion);
        self.iterate(level, coupling, motion)
    }

    /// Iterates so many times.
    fn repeat(
        &mut self,
        count: usize,
        level: &PyramidLevel<T>,
        coupling: &Coupling,
        (motion, old): (&mut Planes<T>, &mut Planes<T>),
    ) {
        for _ in 0..count {
            self.advance(level, coupling, (motion, old));
        }
    }

    /// Tries sites without their neighbours, and gives the `motion` what explains the frames better: small
    /// objects come free.
    pub fn loosen(
        &mut self,
        level: &PyramidLevel<T>,
        coupling: &Coupling,
        (motion, old): (&mut Planes<T>, &mut Planes<T>),
        (pool, space): (&Pool<T>, &Space<T>),
    ) {
        let mut loose = copy(space, motion);
        self.advance(level, &LOOSE.1, (&mut loose, old));
        if moving((motion, &loose), LEAVING, (0..motion.width, 0..motion.height)) > 0 {
            self.repeat(LOOSE.0 - 1, level, &LOOSE.1, (&mut loose, old));
            let Plan { simd, .. } = *self.plan;
            let comparison = Comparison { simd, level, compared: self.compared, scale: self.scale, pool, space };
            if comparison.take_better(motion, &loose, ANOTHER) {
                self.repeat(JOINED, level, coupling, (motion, old));
            }
        }
        space.keep(loose);
    }

    /// Linearises about `motion` and moves it; by how much, px (root mean square).
    fn iterate(&mut self, level: &PyramidLevel<T>, coupling: &Coupling, motion: &mut Planes<T>) -> f64 {
        let views = level.views(self.compared);
        let residuals = self.term.linearise(level.size, &views, motion, self.scale, self.data);
        self.scale = self.spread(residuals);
        let contrast = self.plan.range.contrast;
        let floor = T::from_f64((LEAST_NOISE * contrast).powi(2).max(f64::from(f32::MIN_POSITIVE)));
        couple(self.plan.simd, self.data, motion, coupling, floor, self.scratch)
    }

    /// Robust standard deviation of residuals whose magnitudes these are.
    fn spread(&self, mut residuals: Vec<T>) -> Option<T> {
        let spread = robust_std(&mut residuals)?;
        let least = (LEAST_SCALE * self.plan.range.contrast).max(f64::from(f32::MIN_POSITIVE));
        Some(T::from_f64(spread + least))
    }
}

/// Whether no object is on its way any more, after an iteration `from` a motion `to` another. SamplingGrid of the
/// rim do not count.
pub(super) fn has_settled<T: SimdReal>(from: &Planes<T>, to: &Planes<T>) -> bool {
    inner(from, to) < OBJECT
}

/// How many sites, but for those of the rim, are on their way.
fn inner<T: SimdReal>(from: &Planes<T>, to: &Planes<T>) -> usize {
    let without_rim = |len: usize| {
        let rim = (len / RIM_SHARE).clamp(RIM.0, RIM.1).min(len);
        rim..len.saturating_sub(rim).max(rim)
    };
    moving((from, to), FAR, (without_rim(to.width), without_rim(to.height)))
}

/// How many of the sites in some columns and rows are further than `far` px from where they were.
fn moving<T: SimdReal>(
    (from, to): (&Planes<T>, &Planes<T>),
    far: f64,
    (columns, rows): (Range<usize>, Range<usize>),
) -> usize {
    let far = T::from_f64(far * far);
    let in_row = |y: usize| {
        let [u, v, u0, v0] = [to.line(0, y), to.line(1, y), from.line(0, y), from.line(1, y)];
        let is_far = |&x: &usize| (u[x] - u0[x]) * (u[x] - u0[x]) + (v[x] - v0[x]) * (v[x] - v0[x]) > far;
        columns.clone().filter(is_far).count()
    };
    rows.map(in_row).sum()
}

/// The motion in planes of its own; there may be more planes in what it comes from.
pub(super) fn copy<T: SimdReal>(space: &Space<T>, motion: &Planes<T>) -> Planes<T> {
    let mut out = space.planes(motion.width, motion.height, MOTION);
    for (k, y) in (0..MOTION).flat_map(|k| (0..motion.height).map(move |y| (k, y))) {
        out.line_mut(k, y).copy_from_slice(motion.line(k, y));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_sites_on_their_way_are_seen_but_not_along_the_edge() {
        let (from, mut to) = (Planes::<f32>::new(9, 7, MOTION), Planes::<f32>::new(9, 7, MOTION));
        to.data_mut().fill(0.09);
        assert_eq!(inner(&from, &to), 5 * 3, "the diagonal is far: 0.127 px");
        to.data_mut().fill(0.07);
        assert_eq!(inner(&from, &to), 0);
        for (x, y, u) in [(4, 3, 2.0), (5, 3, -0.2), (1, 3, 2.0), (4, 0, 2.0)] {
            to.line_mut(0, y)[x] = u;
        }
        assert_eq!(inner(&from, &to), 2);
        assert_eq!(moving((&from, &to), 0.15, (0..9, 0..7)), 4);
        let tiny = Planes::<f32>::new(3, 1, MOTION);
        assert_eq!(inner(&tiny, &tiny), 0);
    }
}
