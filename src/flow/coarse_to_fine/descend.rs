//! From level to level: the iterations.

use super::couple::{CoupleScratch, Coupling, couple};
use super::data::{COUNT, DataOptions, DataTerm, MOTION, summary};
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

/// What all iterations have in common.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plan {
    pub simd: Level,
    pub effort: Effort,
    /// How brightness was scaled.
    pub range: Range,
    /// The finest level there is to work on.
    pub last: usize,
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
        self.descend(workspace, Compared::All, motion, &limits)
    }

    /// Once more about a better `motion`, on the finest level.
    pub fn again<T: SimdReal>(&self, workspace: &mut Workspace<T>, motion: &Planes<T>) -> Found<T> {
        let start = copy(&workspace.space, motion);
        self.descend(workspace, Compared::All, start, &vec![self.effort.up_to(1); self.last + 1])
    }

    /// The way for the step to the next frame alone, from two levels above the finest down, where it is no other than `motion`.
    pub fn ahead<T: SimdReal>(&self, workspace: &mut Workspace<T>, motion: &Planes<T>) -> Found<T> {
        let (levels, [finest, others @ ..]) = (workspace.pyramid.levels(), self.effort.ahead);
        let mut start = copy(&workspace.space, motion);
        let mut limits = vec![self.effort.up_to(finest); self.last + 1];
        for (level, most) in levels[self.last + 1..].iter().zip(others) {
            limits.push(self.effort.up_to(most));
            let mut next = workspace.space.planes(0, 0, MOTION);
            coarser(&start, sites(level.size), &mut next);
            workspace.space.keep(std::mem::replace(&mut start, next));
        }
        self.descend(workspace, Compared::Ahead, start, &limits)
    }

    /// From the coarsest of the levels that `limits` names, on which `motion` is.
    fn descend<T: SimdReal>(
        &self,
        workspace: &mut Workspace<T>,
        compared: Compared,
        mut motion: Planes<T>,
        limits: &[Limits],
    ) -> Found<T> {
        let Workspace { pyramid, pool, scratch, space } = workspace;
        let (width, height) = sites(pyramid.levels()[self.last].size);
        let mut data = space.planes(width, height, COUNT);
        let term = DataTerm::new(self.simd, DataOptions::default(), pool);
        let mut step = Step { plan: self, compared, term, data: &mut data, scratch, scale: None };
        let mut old = space.planes(0, 0, MOTION);
        for (k, (level, limit)) in pyramid.levels().iter().zip(limits).enumerate().skip(self.last).rev() {
            if k + 1 < limits.len() {
                std::mem::swap(&mut motion, &mut old);
                finer(self.simd, &old, level.size, &mut motion);
            }
            for _ in 0..limit.most {
                std::mem::swap(&mut motion, &mut old);
                rederive(&old, &mut motion);
                if step.iterate(level, &limit.coupling, &mut motion) <= limit.settled {
                    break;
                }
            }
        }
        space.keep(old);
        let scale = step.scale;
        let summary = summary(space, &data);
        space.keep_small(data);
        Found { motion, data: summary, scale }
    }
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
