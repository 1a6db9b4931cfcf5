//! Entry point: runs the stages from frames to a filled field.

use super::acceleration::to_middle_frame;
use super::brightness_change::{change_along, equalize_roughly};
use super::brightness_scale::BrightnessScale;
use super::descent::{DescentPlan, DescentResult};
use super::detail_bias::DetailBias;
use super::estimate::Estimate;
use super::options::CoarseToFineOptions;
use super::output;
use super::peak_locking::PeakLocking;
use super::pyramid::ComparedFrames;
use super::refine::{RefineOptions, WindowStatistics, refine};
use super::schedule::Schedule;
use super::workspace::{Workspace, WorkspaceStore};
use crate::ablation::keeps;
use crate::error::Result;
use crate::flow::options::EstimatorOptions;
use crate::simd::SimdReal;
use crate::types::{FlowField, Frame};

/// Maximum number of measurements of a change of brightness: the first rest on a motion between unequal
/// frames.
const MAX_MEASUREMENTS: usize = 4;

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
            let mut workspace = self.store.take::<T>(frames[0].size());
            let (plan, coarse, noise_gain) =
                self.coarse_levels(&mut workspace, frames, common, field.covariance.is_some());
            let (coarse, iterations) = match common.initial.as_deref() {
                Some(given) => plan.with_given(&mut workspace, given, frames.len() == 2, coarse),
                None => (coarse, 0),
            };
            let found = plan.estimate_fine_levels(&mut workspace, coarse, iterations);
            let mut estimate = estimate(&plan, found, (frames.len() == 3, self.options.central), &mut workspace);
            estimate.noise_gain = noise_gain;
            let covariance_of = field.covariance.is_some().then(|| output::covariance_of(&estimate, frames, common));
            let refines = plan.schedule.refines_pixels && plan.finest == 0 && keeps("flow.variational_refinement");
            let views = refines.then(|| workspace.pyramid.levels()[0].views_at_reference(self.options.central));
            output::fill((&estimate, covariance_of), &workspace.space, views, frames, common, field);
            estimate.recycle(&workspace);
            self.store.put_back(workspace);
        });
    }

    /// The motion on a coarse level, between frames without changes of brightness; with the factor of the
    /// variance of the noise that their removal brings.
    fn coarse_levels<T: SimdReal>(
        &self,
        workspace: &mut Workspace<T>,
        frames: &[&Frame<T>],
        common: &EstimatorOptions,
        keeps_levels: bool,
    ) -> (DescentPlan, DescentResult<T>, f64) {
        let (simd, mask) = (common.level(), common.mask.as_ref());
        let schedule = Schedule::new(self.options.preset, frames.len());
        let levels = (self.options.levels, schedule.finest_level);
        let mut equalized = equalize_roughly(frames, mask);
        let mut measurements = 0;
        loop {
            let equal: Vec<&Frame<T>> = equalized.iter().flat_map(|equalized| &equalized.frames).collect();
            let compared = if equal.is_empty() { frames } else { &equal };
            let brightness = BrightnessScale::of(compared, mask);
            let finest = workspace.pyramid.fill(simd, compared, brightness, mask, levels);
            let plan = DescentPlan { simd, schedule, brightness, finest, keeps_levels };
            let level = plan.coarse_level(workspace);
            let coarse = plan.estimate_coarse_levels(workspace);
            let views = workspace.pyramid.levels()[level].views(ComparedFrames::All);
            let pixel = f64::from(1u32 << level);
            let change = change_along(simd, (&views, brightness), (&coarse.motion, pixel), equalized.as_ref());
            measurements += 1;
            // To equalise frames without contrast would make texture of their rounding.
            let has_contrast = |frame: &&Frame<T>| BrightnessScale::of(&[*frame], mask).contrast > 0.0;
            let change = change.filter(|_| measurements < MAX_MEASUREMENTS && frames.iter().all(has_contrast));
            let Some(change) = change else {
                return (plan, coarse, equalized.map_or(1.0, |equalized| equalized.noise_gain));
            };
            coarse.recycle(&workspace.space);
            equalized = change.removed_from(frames);
        }
    }
}

fn estimate<T: SimdReal>(
    plan: &DescentPlan,
    mut found: DescentResult<T>,
    (is_triple, central): (bool, bool),
    workspace: &mut Workspace<T>,
) -> Estimate<T> {
    let simd = plan.simd;
    let (mut motion, mut statistics) =
        refine(simd, &workspace.space, &RefineOptions::default(), &found.motion, &found.data);
    if is_triple {
        // Linearised about the refined motion, the residual is noise; about the regularised motion it also
        // contains what the windows of the data term smooth away.
        statistics.into_iter().flat_map(WindowStatistics::into_planes).for_each(|planes| workspace.space.keep(planes));
        let mut better = plan.relinearise(workspace, &motion);
        better.coarser = found.coarser;
        for planes in [motion, found.motion, found.data] {
            workspace.space.keep(planes);
        }
        found = better;
        (motion, statistics) =
            refine(simd, &workspace.space, &RefineOptions::relinearised(), &found.motion, &found.data);
    }
    let DescentResult { motion: mut regularized, data, residual_std, coarser } = found;
    let locking = PeakLocking::measure(
        simd,
        (&workspace.pyramid.levels()[plan.finest], ComparedFrames::All),
        &motion,
        residual_std,
    );
    locking.correct(simd, &mut motion);
    let corrects = plan.finest == 0 && keeps("flow.detail_bias");
    let detail = (corrects || plan.keeps_levels).then(|| DetailBias::measure(plan, workspace, &motion, residual_std));
    if let Some(detail) = detail.as_ref().filter(|_| corrects) {
        detail.correct(&mut motion);
    }
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
        noise_gain: 1.0,
        statistics,
        acceleration,
        detail,
        locking,
        coarser,
    }
}
