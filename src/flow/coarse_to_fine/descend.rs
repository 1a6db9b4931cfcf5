//! From level to level: the iterations.

use super::candidates::Comparison;
use super::data::{COUNT, DataOptions, DataTerm, MOTION, summary};
use super::further::refine_further;
use super::grid::Planes;
use super::levels::Compared;
use super::memory::Workspace;
use super::options::{Effort, Limits};
use super::range::Range;
use super::resample::{coarser, finer};
use super::step::{Step, copy, has_settled};
use crate::simd::{Level, SimdReal};
use std::ops::RangeInclusive;

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

    /// The way for the step to the next frame alone, from two levels above the finest down. It begins with
    /// what is known of all frames together, the `motion`, but for what the next frame alone tells better on
    /// the levels above: things may turn back.
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

    /// Gives the `motion` on a level what the next frame alone, from the coarsest level down to the one
    /// above, tells better.
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
                let is_calm = || k == self.last || has_settled(&old, &motion);
                if change <= limit.settled && is_calm() {
                    break;
                }
            }
            if limit.loosened {
                step.loosen(level, &limit.coupling, (&mut motion, &mut old), (pool, space));
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

/// The motion on the last of some levels from that on the first.
fn raised<T: SimdReal>(workspace: &Workspace<T>, motion: &Planes<T>, levels: RangeInclusive<usize>) -> Planes<T> {
    let space = &workspace.space;
    let mut out = copy(space, motion);
    for level in levels.skip(1) {
        let mut next = space.planes(0, 0, MOTION);
        coarser(&out, sites(workspace.pyramid.levels()[level].size), &mut next);
        space.keep(std::mem::replace(&mut out, next));
    }
    out
}

/// SamplingGrid along x and y of a level of `size` pixels.
fn sites(size: (usize, usize)) -> (usize, usize) {
    (size.0.div_ceil(2), size.1.div_ceil(2))
}
