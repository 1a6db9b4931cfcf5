//! From level to level: the iterations.

use super::candidates::Comparison;
use super::couple::{CoupleScratch, Coupling, couple};
use super::data::{COUNT, DataOptions, DataTerm, MOTION, summary};
use super::further::refine_further;
use super::grid::Planes;
use super::levels::{Compared, PyramidLevel};
use super::memory::{Space, Workspace};
use super::options::{Effort, Limits};
use super::range::Range;
use super::resample::{coarser, finer, rederive};
use crate::simd::{Level, SimdReal};

/// Noise is taken for at least this share of the brightness' standard deviation.
const LEAST_NOISE: f64 = 1e-3;
/// The scale of the robust weights is at least this share of the brightness' standard deviation.
const LEAST_SCALE: f64 = 4e-3;

/// A site that an iteration moves further than this is on its way, px of the level.
const FAR: f64 = 0.1;
/// So many of those may be an object that is too small to be felt in the mean over the frame.
const OBJECT: usize = 4;
/// Sites along the edge that do not count: what leaves the frame there may drift for ever.
const RIM: usize = 2;

/// Iterations with loose bonds, and these: each site follows its own data. A small object that moves before a still ground is held back by the usual ones, but the
/// ground could not be told as well.
const LOOSE: (usize, Coupling) = (3, Coupling { flow: 1.0, jacobian: 100.0, break_at: 0.1, sweeps: 4, reweigh: 2 });
/// What they find is another motion when it is further away than this, px of the level; nearer, it is the same with more noise.
const ANOTHER: f64 = 0.5;
/// Iterations that join both motions.
const JOINED: usize = 2;

/// What all iterations have in common.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plan {
    pub simd: Level,
    pub effort: Effort,
    /// How brightness was scaled.
    pub range: Range,
    /// The finest level there is to work on.
    pub last: usize,
    /// Whether [`Plan::all`] keeps what it finds on the way.
    pub traced: bool,
}

/// What there is on the finest level.
#[derive(Debug)]
pub(super) struct Found<T> {
    /// The coupled motion.
    pub motion: Planes<T>,
    /// The summary of the last data term.
    pub data: Planes<T>,
    /// Standard deviation of the residual.
    pub scale: Option<T>,
    /// The coupled motion on each coarser level, the finest of them first, where it was to be kept.
    pub above: Vec<Planes<T>>,
}

impl Plan {
    /// The way down from the coarsest level of the filled pyramid, where nothing is known.
    pub fn all<T: SimdReal>(&self, workspace: &mut Workspace<T>) -> Found<T> {
        let levels = workspace.pyramid.levels();
        let coarsest = levels.len() - 1;
        let sites = sites(levels[coarsest].size);
        let limits: Vec<_> =
            (0..levels.len()).map(|k| self.effort.on_level(k, levels[k].size, k == coarsest)).collect();
        let mut motion = workspace.space.planes(sites.0, sites.1, MOTION);
        motion.data_mut().fill(T::from_f64(0.0));
        self.descend(workspace, Compared::All, motion, (&limits, self.last))
    }

    /// Once more about a better `motion`, on the finest level.
    pub fn again<T: SimdReal>(&self, workspace: &mut Workspace<T>, motion: &Planes<T>) -> Found<T> {
        let start = copy(&workspace.space, motion);
        self.descend(
            workspace,
            Compared::All,
            start,
            (&vec![self.effort.up_to(self.last, 1); self.last + 1], self.last),
        )
    }

    /// The way for the step to the next frame alone, from two levels above the finest down. It begins with what is known of all frames together, the `motion`, but for what the next
    /// frame alone tells better on the levels above: things may turn back.
    pub fn ahead<T: SimdReal>(&self, workspace: &mut Workspace<T>, motion: &Planes<T>) -> Found<T> {
        let coarsest = workspace.pyramid.levels().len() - 1;
        let first = coarsest.min(self.last + self.effort.ahead.len() - 1);
        let mut start = raised(workspace, motion, self.last..=first);
        if first < coarsest {
            self.take_own(workspace, first, &mut start);
        }
        let most = |k: usize| self.effort.ahead[k.saturating_sub(self.last)];
        let limits: Vec<_> = (0..=first).map(|k| self.effort.up_to(k, most(k))).collect();
        self.untraced().descend(workspace, Compared::Ahead, start, (&limits, self.last))
    }

    /// The same, but that nothing is kept on the way.
    fn untraced(&self) -> Self {
        Self { traced: false, ..*self }
    }

    /// Gives the `motion` on a level what the next frame alone, from the coarsest level down to the one above, tells better.
    fn take_own<T: SimdReal>(&self, workspace: &mut Workspace<T>, level: usize, motion: &mut Planes<T>) {
        let levels = workspace.pyramid.levels();
        let coarsest = levels.len() - 1;
        let limits: Vec<_> = (0..=coarsest).map(|k| self.effort.on_level(k, levels[k].size, k == coarsest)).collect();
        let start = raised(workspace, motion, level..=coarsest);
        let Found { motion: above, data, scale, .. } =
            self.untraced().descend(workspace, Compared::Ahead, start, (&limits, level + 1));
        let Workspace { pyramid, pool, space, .. } = workspace;
        let level = &pyramid.levels()[level];
        let mut own = space.planes(0, 0, MOTION);
        finer(self.simd, &above, level.size, &mut own);
        let comparison = Comparison { simd: self.simd, level, compared: Compared::Ahead, scale, pool, space };
        comparison.take_better(motion, &own, 0.0);
        for planes in [above, data, own] {
            space.keep(planes);
        }
    }

    /// From the coarsest of the levels that `limits` names, on which `motion` is, down to the level `to`.
    fn descend<T: SimdReal>(
        &self,
        workspace: &mut Workspace<T>,
        compared: Compared,
        mut motion: Planes<T>,
        (limits, to): (&[Limits], usize),
    ) -> Found<T> {
        let Workspace { pyramid, pool, scratch, space } = workspace;
        let (width, height) = sites(pyramid.levels()[to].size);
        let mut data = space.planes(width, height, COUNT);
        let term = DataTerm::new(self.simd, DataOptions::default(), pool);
        let mut step = Step { plan: self, compared, term, data: &mut data, scratch, scale: None };
        let mut old = space.planes(0, 0, MOTION);
        let mut above = Vec::new();
        for (k, (level, limit)) in pyramid.levels().iter().zip(limits).enumerate().skip(to).rev() {
            if k + 1 < limits.len() {
                std::mem::swap(&mut motion, &mut old);
                finer(self.simd, &old, level.size, &mut motion);
            }
            for _ in 0..limit.most {
                let change = step.advance(level, &limit.coupling, (&mut motion, &mut old));
                // On the finest level what is left to do is for the coarser ones to have done.
                let is_calm = || k == self.last || moving(&old, &motion) < OBJECT;
                if change <= limit.settled && is_calm() {
                    break;
                }
            }
            if limit.loosened {
                let mut loose = copy(space, &motion);
                step.repeat(LOOSE.0, level, &LOOSE.1, (&mut loose, &mut old));
                let comparison = Comparison { simd: self.simd, level, compared, scale: step.scale, pool, space };
                if comparison.take_better(&mut motion, &loose, ANOTHER) {
                    step.repeat(JOINED, level, &limit.coupling, (&mut motion, &mut old));
                }
                space.keep(loose);
            }
            if limit.refined {
                refine_further(self.simd, space, &mut motion, step.data);
            }
            if self.traced && k > to {
                above.insert(0, copy(space, &motion));
            }
        }
        space.keep(old);
        let scale = step.scale;
        let summary = summary(space, &data);
        space.keep_small(data);
        Found { motion, data: summary, scale, above }
    }
}

/// How many sites, but for those of the rim, an iteration moved by more than [`FAR`].
fn moving<T: SimdReal>(from: &Planes<T>, to: &Planes<T>) -> usize {
    let inner = |len: usize| RIM.min(len)..len.saturating_sub(RIM).max(RIM.min(len));
    let far = T::from_f64(FAR * FAR);
    let in_row = |y: usize| {
        let [u, v, u0, v0] = [to.line(0, y), to.line(1, y), from.line(0, y), from.line(1, y)];
        inner(to.width).filter(|&x| (u[x] - u0[x]) * (u[x] - u0[x]) + (v[x] - v0[x]) * (v[x] - v0[x]) > far).count()
    };
    inner(to.height).map(in_row).sum()
}

/// The motion on the last of some levels from that on the first.
fn raised<T: SimdReal>(
    workspace: &Workspace<T>,
    motion: &Planes<T>,
    levels: std::ops::RangeInclusive<usize>,
) -> Planes<T> {
    let space = &workspace.space;
    let mut out = copy(space, motion);
    for level in levels.skip(1) {
        let mut next = space.planes(0, 0, MOTION);
        coarser(&out, sites(workspace.pyramid.levels()[level].size), &mut next);
        space.keep(std::mem::replace(&mut out, next));
    }
    out
}

/// The motion in planes of its own; there may be more planes in what it comes from.
fn copy<T: SimdReal>(space: &Space<T>, motion: &Planes<T>) -> Planes<T> {
    let mut out = space.planes(motion.width, motion.height, MOTION);
    for (k, y) in (0..MOTION).flat_map(|k| (0..motion.height).map(move |y| (k, y))) {
        out.line_mut(k, y).copy_from_slice(motion.line(k, y));
    }
    out
}

/// Sites along x and y of a level of `size` pixels.
fn sites(size: (usize, usize)) -> (usize, usize) {
    (size.0.div_ceil(2), size.1.div_ceil(2))
}

/// One linearisation, and the motion that follows from it.
struct Step<'a, T> {
    plan: &'a Plan,
    compared: Compared,
    term: DataTerm<'a, T>,
    data: &'a mut Planes<T>,
    scratch: &'a mut CoupleScratch<T>,
    /// Standard deviation of what brightness changes by along the motion, from the iteration before.
    scale: Option<T>,
}

impl<T: SimdReal> Step<'_, T> {
    /// Iterates once; the motion before is the `old` one afterwards.
    fn advance(
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
        if residuals.is_empty() {
            return None;
        }
        let middle = residuals.len() / 2;
        residuals.select_nth_unstable_by(middle, |a, b| a.to_f64().total_cmp(&b.to_f64()));
        let least = (LEAST_SCALE * self.plan.range.contrast).max(f64::from(f32::MIN_POSITIVE));
        Some(T::from_f64(1.4826 * residuals[middle].to_f64() + least))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_sites_on_their_way_are_seen_but_not_along_the_edge() {
        let (from, mut to) = (Planes::<f32>::new(9, 7, MOTION), Planes::<f32>::new(9, 7, MOTION));
        to.data_mut().fill(0.09);
        assert_eq!(moving(&from, &to), 5 * 3, "the diagonal is far: 0.127 px");
        to.data_mut().fill(0.07);
        assert_eq!(moving(&from, &to), 0);
        for (x, y, u) in [(4, 3, 2.0), (5, 3, -0.2), (1, 3, 2.0), (4, 0, 2.0)] {
            to.line_mut(0, y)[x] = u;
        }
        assert_eq!(moving(&from, &to), 2);
        let tiny = Planes::<f32>::new(3, 1, MOTION);
        assert_eq!(moving(&tiny, &tiny), 0);
    }
}
