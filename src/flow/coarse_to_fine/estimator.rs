//! Entry point: runs the stages from frames to a filled field.

use super::acceleration::to_middle_frame;
use super::brightness_scale::BrightnessScale;
use super::covariance::CovarianceMaps;
use super::descent::{DescentPlan, DescentResult};
use super::estimate::Estimate;
use super::options::CoarseToFineOptions;
use super::output;
use super::peak_locking::PeakLocking;
use super::pyramid::ComparedFrames;
use super::refine::{RefineOptions, WindowStatistics, refine};
use super::schedule::Schedule;
use super::workspace::{Workspace, WorkspaceStore};
use crate::error::Result;
use crate::flow::options::{EstimatorOptions, InitialFlow};
use crate::simd::SimdReal;
use crate::types::{FlowField, Frame};

#[derive(Debug)]
pub(in crate::flow) struct CoarseToFine {
    options: CoarseToFineOptions,
    store: WorkspaceStore,
}

impl CoarseToFine {
    pub fn new(options: &CoarseToFineOptions) -> Result<Self> {
        options.check()?;
        Ok(Self { options: options.clone(), store: WorkspaceStore::default() })
    }

    /// Frames of one estimate, 2 or 3.
    pub fn frames_needed(&self) -> usize {
        self.options.frames
    }

    pub fn frame(&self) -> usize {
        self.options.frames - 2
    }

    /// Fills `field`, in px and frames, from `frames_needed` frames of one size, oldest first.
    pub fn estimate_into<T: SimdReal>(
        &self,
        frames: &[&Frame<T>],
        common: &EstimatorOptions,
        field: &mut FlowField<T>,
    ) {
        common.threads.install(|| {
            let simd = common.level();
            let brightness = BrightnessScale::of(frames, common.mask.as_ref());
            let mut workspace = self.store.take::<T>();
            let schedule = Schedule::new(self.options.preset, frames.len());
            let levels = (self.options.levels, schedule.finest_level);
            let finest = workspace.pyramid.fill(simd, frames, brightness, common.mask.as_ref(), levels);
            let plan = DescentPlan { simd, schedule, brightness, finest, keeps_levels: field.covariance.is_some() };
            let initial = common.initial.as_deref();
            let mut estimate = estimate(&plan, (frames.len() == 3, self.options.central), initial, &mut workspace);
            let covariance_of = covariance_of(&mut estimate, &mut workspace, (frames, common), field);
            output::fill((&estimate, covariance_of), &workspace.space, frames, common, field);
            estimate.recycle(&workspace);
            self.store.put_back(workspace);
        });
    }
}

/// The covariance, if requested. It needs so many planes that other memory is returned first.
fn covariance_of<T: SimdReal>(
    estimate: &mut Estimate<T>,
    workspace: &mut Workspace<T>,
    (frames, common): (&[&Frame<T>], &EstimatorOptions),
    field: &FlowField<T>,
) -> Option<CovarianceMaps<T>> {
    if field.covariance.is_none() {
        workspace.clear_if_large();
        return None;
    }
    let is_large = workspace.is_large();
    if is_large {
        workspace.release_to_system(estimate.planes_mut());
    }
    let covariance_of = output::covariance_of(estimate, frames, common);
    if is_large && field.window.is_none() {
        estimate.release_statistics(workspace);
        workspace.release_to_system(estimate.planes_mut());
    }
    Some(covariance_of)
}

fn estimate<T: SimdReal>(
    plan: &DescentPlan,
    (is_triple, central): (bool, bool),
    initial: Option<&InitialFlow>,
    workspace: &mut Workspace<T>,
) -> Estimate<T> {
    let simd = plan.simd;
    let mut found = match initial {
        Some(given) => plan.estimate_from(workspace, given, !is_triple),
        None => plan.estimate_all_levels(workspace),
    };
    let (mut motion, mut statistics) =
        refine(simd, &workspace.space, &RefineOptions::default(), &found.motion, &found.data);
    if is_triple {
        // Linearised about the refined motion, the residual is noise; about the regularised motion it also
        // contains what the windows of the data term smooth away.
        statistics.into_iter().flat_map(WindowStatistics::into_planes).for_each(|planes| workspace.space.keep(planes));
        // The data term and the refinement together would be the peak of memory.
        workspace.release_to_system_if_large();
        let mut better = plan.relinearise(workspace, &motion);
        better.coarser_motions = found.coarser_motions;
        for planes in [motion, found.motion, found.data] {
            workspace.space.keep(planes);
        }
        found = better;
        (motion, statistics) =
            refine(simd, &workspace.space, &RefineOptions::relinearised(), &found.motion, &found.data);
    }
    let DescentResult { motion: mut regularized, data, residual_std, coarser_motions } = found;
    let locking = PeakLocking::measure(
        simd,
        (&workspace.pyramid.levels()[plan.finest], ComparedFrames::All),
        &motion,
        residual_std,
    );
    locking.correct(simd, &mut motion);
    let mut acceleration = None;
    if is_triple {
        locking.correct(simd, &mut regularized);
        acceleration = to_middle_frame(plan, workspace, regularized, &mut motion, central);
    } else {
        workspace.space.keep(regularized);
    }
    Estimate {
        level: plan.finest,
        motion,
        data,
        brightness: plan.brightness,
        statistics,
        acceleration,
        locking,
        coarser_motions,
    }
}
