//! Descent through the pyramid: iterations on each level, from the coarsest to the finest.
//!
//! `weighted_median` sharpens the flow at motion boundaries before an iteration; `iteration` is one
//! linearisation with its regularised solution, and the unregularised trial;
//! `continuation` sets the motion of sites without data;
//! `block_matches` finds large motions; `comparison` takes the better of two motions at each site;
//! `intermediate` refines a level before the next one; `given` lets a flow from elsewhere compete.

mod block_matches;
pub(super) mod comparison;
mod continuation;
mod given;
mod intermediate;
mod iteration;
mod weighted_median;

use super::brightness_scale::BrightnessScale;
use super::data_term::{COUNT, DataOptions, DataTerm, MOTION, summary};
use super::peak_locking::PeakLocking;
use super::plane_pool::PlanePool;
use super::planes::Planes;
use super::pyramid::{ComparedFrames, PyramidLevel};
use super::resample::{coarser, finer};
use super::schedule::{LevelSchedule, Schedule};
use super::workspace::Workspace;
use crate::ablation::keeps;
use crate::simd::{Level, SimdReal};
use comparison::Comparison;
use intermediate::refine_intermediate;
use iteration::{Iteration, copy, has_settled};
use std::ops::RangeInclusive;
pub(super) use weighted_median::beside_boundaries;

/// Levels from the coarse level down to the finest.
const LEVELS_ABOVE: usize = 2;

#[derive(Debug, Clone, Copy)]
pub(super) struct DescentPlan {
    pub simd: Level,
    pub schedule: Schedule,
    pub brightness: BrightnessScale,
    pub finest: usize,
    /// Whether coarser levels are kept, for the covariance.
    pub keeps_levels: bool,
}

#[derive(Debug)]
pub(super) struct DescentResult<T> {
    /// The regularised motion.
    pub motion: Planes<T>,
    pub data: Planes<T>,
    /// Standard deviation of the residual, grey levels.
    pub residual_std: Option<T>,
    /// The coarser levels, the finest first, if kept.
    pub coarser: Vec<CoarserLevel<T>>,
}

/// What the covariance needs of a coarser level.
#[derive(Debug)]
pub(super) struct CoarserLevel<T> {
    /// The regularised motion.
    pub motion: Planes<T>,
    /// Summary of the last data term.
    pub data: Planes<T>,
}

impl<T: SimdReal> CoarserLevel<T> {
    /// Returns all planes.
    pub fn recycle(self, space: &PlanePool<T>) {
        space.keep(self.motion);
        space.keep(self.data);
    }
}

impl<T: SimdReal> DescentResult<T> {
    /// Returns all planes.
    pub fn recycle(self, space: &PlanePool<T>) {
        self.coarser.into_iter().for_each(|level| level.recycle(space));
        space.keep(self.motion);
        space.keep(self.data);
    }
}

impl DescentPlan {
    /// The level on which brightness is compared and a given flow competes: errors are smaller than
    /// structure.
    pub fn coarse_level<T: SimdReal>(&self, workspace: &Workspace<T>) -> usize {
        (self.finest + LEVELS_ABOVE).min(workspace.pyramid.levels().len() - 1)
    }

    /// Descends from the coarsest level of the filled pyramid, starting without motion, to the coarse level.
    pub fn estimate_coarse_levels<T: SimdReal>(&self, workspace: &mut Workspace<T>) -> DescentResult<T> {
        let levels = workspace.pyramid.levels();
        let schedules = self.schedules(levels);
        let (width, height) = levels.last().map_or((0, 0), |level| site_counts(level.size));
        let mut rest = workspace.space.planes(width, height, MOTION);
        rest.data_mut().fill(T::from_f64(0.0));
        self.descend(workspace, ComparedFrames::All, (rest, None), (&schedules, self.coarse_level(workspace)))
    }

    /// Descends further from the result on the coarse level, after `iterations` there.
    pub fn estimate_fine_levels<T: SimdReal>(
        &self,
        workspace: &mut Workspace<T>,
        coarse: DescentResult<T>,
        iterations: usize,
    ) -> DescentResult<T> {
        let from = self.coarse_level(workspace);
        if from == self.finest && iterations == 0 {
            return coarse;
        }
        let mut schedules = self.schedules(workspace.pyramid.levels());
        schedules.truncate(from + 1);
        schedules[from] = LevelSchedule {
            max_iterations: iterations,
            runs_trial: false,
            searches: false,
            refines: false,
            ..schedules[from]
        };
        let DescentResult { motion, data, residual_std, coarser } = coarse;
        let mut fine = self.descend(workspace, ComparedFrames::All, (motion, residual_std), (&schedules, self.finest));
        // Without iterations there, the level the descent began on has the data of the coarse result.
        let data = match fine.coarser.last_mut() {
            Some(level) if iterations == 0 => std::mem::replace(&mut level.data, data),
            _ => data,
        };
        workspace.space.keep(data);
        fine.coarser.extend(coarser);
        fine
    }

    /// The schedule of every level.
    fn schedules<T>(&self, levels: &[PyramidLevel<T>]) -> Vec<LevelSchedule> {
        let count = levels.len();
        let sizes = levels.iter().map(|level| level.size);
        let searched = self.schedule.searched_level(sizes.clone());
        let schedule = |(k, size)| LevelSchedule {
            searches: Some(k) == searched,
            ..self.schedule.on_level(k, size, k + 1 == count)
        };
        sizes.enumerate().map(schedule).collect()
    }

    /// Repeats the finest level about a better `motion`.
    pub fn relinearise<T: SimdReal>(&self, workspace: &mut Workspace<T>, motion: &Planes<T>) -> DescentResult<T> {
        let start = copy(&workspace.space, motion);
        self.descend(
            workspace,
            ComparedFrames::All,
            (start, None),
            (&vec![self.schedule.up_to(self.finest, 1); self.finest + 1], self.finest),
        )
    }

    /// The step to the next frame alone, from two levels above the finest down. Starts from the `motion` of
    /// all frames, or of the next frame where that is better on coarser levels: objects may turn back.
    pub fn next_step<T: SimdReal>(&self, workspace: &mut Workspace<T>, motion: &Planes<T>) -> DescentResult<T> {
        let coarsest = workspace.pyramid.levels().len() - 1;
        let first = coarsest.min(self.finest + self.schedule.next_frame_iterations.len() - 1);
        let mut start = coarsened(workspace, motion, self.finest..=first);
        if first < coarsest {
            self.replace_from_next_frame(workspace, first, &mut start);
        }
        let most = |k: usize| self.schedule.next_frame_iterations[k.saturating_sub(self.finest)];
        let schedules: Vec<_> = (0..=first).map(|k| self.schedule.up_to(k, most(k))).collect();
        self.without_levels().descend(workspace, ComparedFrames::Ahead, (start, None), (&schedules, self.finest))
    }

    fn without_levels(&self) -> Self {
        Self { keeps_levels: false, ..*self }
    }

    /// Replaces the `motion` on a level where the middle and the next frame alone, from the coarsest level
    /// down to the one above, give a better one.
    fn replace_from_next_frame<T: SimdReal>(&self, workspace: &mut Workspace<T>, level: usize, motion: &mut Planes<T>) {
        let levels = workspace.pyramid.levels();
        let coarsest = levels.len() - 1;
        let schedules = self.schedules(levels);
        let start = coarsened(workspace, motion, level..=coarsest);
        let DescentResult { motion: coarser, data, residual_std, .. } =
            self.without_levels().descend(workspace, ComparedFrames::Ahead, (start, None), (&schedules, level + 1));
        let Workspace { pyramid, pool, space, .. } = workspace;
        let level = &pyramid.levels()[level];
        let (width, height) = site_counts(level.size);
        let mut own = space.planes(width, height, MOTION);
        finer(self.simd, &coarser, level.size, &mut own);
        let (simd, compared, follows_majority) = (self.simd, ComparedFrames::Ahead, false);
        let comparison = Comparison { simd, level, compared, residual_std, follows_majority, pool, space };
        comparison.replace_where_better(motion, &own, 0.0);
        for planes in [coarser, data, own] {
            space.keep(planes);
        }
    }

    /// Descends from the coarsest level that has a schedule, on which the motion and the standard deviation
    /// of the residual, if known, are given, to the level `to`.
    fn descend<T: SimdReal>(
        &self,
        workspace: &mut Workspace<T>,
        compared: ComparedFrames,
        (start, residual_std): (Planes<T>, Option<T>),
        (schedules, to): (&[LevelSchedule], usize),
    ) -> DescentResult<T> {
        let Workspace { pyramid, pool, scratch, space, .. } = workspace;
        let (width, height) = site_counts(pyramid.levels()[to].size);
        let mut data = space.planes(width, height, COUNT);
        let term = DataTerm::new(self.simd, DataOptions::default(), pool);
        let mut step = Iteration { plan: self, compared, term, data: &mut data, scratch, residual_std };
        // With room for the finest level: both grow on the way.
        let [mut motion, mut old] = [0, 1].map(|_| space.planes(width, height, MOTION));
        motion.copy_from(&start);
        space.keep(start);
        let mut coarser = Vec::new();
        for (k, (level, schedule)) in pyramid.levels().iter().zip(schedules).enumerate().skip(to).rev() {
            if k + 1 < schedules.len() {
                std::mem::swap(&mut motion, &mut old);
                finer(self.simd, &old, level.size, &mut motion);
            }
            for n in 0..schedule.max_iterations {
                if n >= schedule.sharpens_from {
                    step.sharpen(level, &mut motion, space);
                }
                let change = step.advance(level, &schedule.smoothness, (&mut motion, &mut old));
                // The finest level does not wait for objects: coarser levels have found them.
                let is_calm = || k == self.finest || has_settled(&old, &motion);
                if change <= schedule.tolerance && is_calm() {
                    break;
                }
            }
            if schedule.searches {
                step.try_block_matches(level, &schedule.smoothness, (&mut motion, &mut old), (pool, space));
            }
            if schedule.runs_trial {
                step.try_unregularized(level, &schedule.smoothness, (&mut motion, &mut old), (pool, space));
            }
            if schedule.refines {
                refine_intermediate(self.simd, space, &mut motion, step.data);
            }
            if k > to && keeps("flow.coarse_peak_locking") {
                // What a level leaves of its own aliases is not corrected where finer levels have noise.
                PeakLocking::measure(self.simd, (level, compared), &motion, step.residual_std)
                    .correct(self.simd, &mut motion);
            }
            if self.keeps_levels && k > to {
                coarser.insert(0, CoarserLevel { motion: copy(space, &motion), data: summary(space, step.data) });
            }
        }
        space.keep(old);
        let residual_std = step.residual_std;
        let summary = summary(space, &data);
        space.keep(data);
        DescentResult { motion, data: summary, residual_std, coarser }
    }
}

/// Carries the motion from the first of some levels up to the last.
fn coarsened<T: SimdReal>(workspace: &Workspace<T>, motion: &Planes<T>, levels: RangeInclusive<usize>) -> Planes<T> {
    let space = &workspace.space;
    let mut out = copy(space, motion);
    for level in levels.skip(1) {
        let size = site_counts(workspace.pyramid.levels()[level].size);
        let mut next = space.planes(size.0, size.1, MOTION);
        coarser(&out, size, &mut next);
        space.keep(std::mem::replace(&mut out, next));
    }
    out
}

/// Sites along x and y of a level of `size` pixels.
fn site_counts(size: (usize, usize)) -> (usize, usize) {
    (size.0.div_ceil(2), size.1.div_ceil(2))
}
