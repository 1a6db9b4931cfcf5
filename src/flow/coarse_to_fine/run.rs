//! From frames to a filled field: the pyramid, the iterations, the results.

use super::change::settle;
use super::covariance::Spreads;
use super::descend::{Found, Plan};
use super::grid::Planes;
use super::levels::Compared;
use super::locking::Locking;
use super::memory::{Memory, Workspace};
use super::options::CoarseToFineOptions;
use super::output;
use super::range::Range;
use super::refine::{Evidence, Options as Refinement, refine};
use crate::error::Result;
use crate::flow::options::EstimatorOptions;
use crate::simd::SimdReal;
use crate::types::{FlowField, Frame};

/// The estimator behind the options.
#[derive(Debug)]
pub(in crate::flow) struct CoarseToFine {
    options: CoarseToFineOptions,
    memory: Memory,
}

impl CoarseToFine {
    /// Checks the options.
    pub fn new(options: &CoarseToFineOptions) -> Result<Self> {
        options.check()?;
        Ok(Self { options: options.clone(), memory: Memory::default() })
    }

    /// Frames of one estimate, 2 or 3.
    pub fn frames_needed(&self) -> usize {
        self.options.frames
    }

    /// Which of the frames the estimate belongs to.
    pub fn frame(&self) -> usize {
        self.options.frames - 2
    }

    /// Fills `field`, in px and frames. `frames`: as many as needed, of one size, oldest first.
    pub fn estimate_into<T: SimdReal>(
        &self,
        frames: &[&Frame<T>],
        common: &EstimatorOptions,
        field: &mut FlowField<T>,
    ) {
        common.threads.install(|| {
            let simd = common.level();
            let range = Range::of(frames, common.mask.as_ref());
            let mut workspace = self.memory.take::<T>();
            let effort = self.options.preset.effort(frames.len());
            let levels = (self.options.levels, effort.last);
            let last = workspace.pyramid.fill(simd, frames, range, common.mask.as_ref(), levels);
            let plan = Plan { simd, effort, range, last, traced: field.covariance.is_some() };
            let mut estimate = estimate(&plan, frames.len() == 3, self.options.central, &mut workspace);
            let spread = spread(&mut estimate, &mut workspace, (frames, common), field);
            output::fill((&estimate, spread), &workspace.space, frames, common, field);
            estimate.keep(&workspace);
            self.memory.give(workspace);
        });
    }
}

/// The covariance, if it is wanted. It takes so many planes that of large frames whatever else there is goes
/// back to the system, before and after.
fn spread<T: SimdReal>(
    estimate: &mut Estimate<T>,
    workspace: &mut Workspace<T>,
    (frames, common): (&[&Frame<T>], &EstimatorOptions),
    field: &FlowField<T>,
) -> Option<Spreads<T>> {
    if field.covariance.is_none() {
        workspace.clear_large();
        return None;
    }
    let is_large = workspace.is_large();
    if is_large {
        workspace.give_back(estimate.planes_mut());
    }
    let spread = output::spread(estimate, frames, common);
    if is_large && field.window.is_none() {
        estimate.forget_evidence(workspace);
        workspace.give_back(estimate.planes_mut());
    }
    Some(spread)
}

/// From the filled pyramid to the motion of two frames or three.
fn estimate<T: SimdReal>(plan: &Plan, is_triple: bool, central: bool, workspace: &mut Workspace<T>) -> Estimate<T> {
    let simd = plan.simd;
    let mut found = plan.all(workspace);
    let (mut motion, mut evidence) = refine(simd, &workspace.space, &Refinement::default(), &found.motion, &found.data);
    if is_triple {
        // About the refined motion the residual is noise; about the coupled one it is also what the windows
        // of the data smooth away.
        evidence.into_iter().flat_map(Evidence::into_planes).for_each(|planes| workspace.space.keep(planes));
        // The data term and what refinement leaves would be the most memory there ever is.
        workspace.give_back_large();
        let mut better = plan.again(workspace, &motion);
        better.above = found.above;
        for planes in [motion, found.motion, found.data] {
            workspace.space.keep(planes);
        }
        found = better;
        (motion, evidence) = refine(simd, &workspace.space, &Refinement::again(), &found.motion, &found.data);
    }
    let Found { motion: mut coupled, data, scale, above } = found;
    let locking = Locking::measure(simd, (&workspace.pyramid.levels()[plan.last], Compared::All), &motion, scale);
    locking.correct(simd, &mut motion);
    let mut change = None;
    if is_triple {
        locking.correct(simd, &mut coupled);
        change = settle(plan, workspace, coupled, &mut motion, central);
    } else {
        workspace.space.keep(coupled);
    }
    Estimate { level: plan.last, motion, data, range: plan.range, evidence, change, locking, above }
}

/// The motion on the sites of the finest level worked on, and what it rests on.
#[derive(Debug)]
pub(super) struct Estimate<T> {
    /// The level of the pyramid that all lengths are in pixels of.
    pub level: usize,
    /// `u, v, u_x, v_x, u_y, v_y` on every second pixel: of a pair midway in time, of a triple at the middle
    /// frame.
    pub motion: Planes<T>,
    /// The summary of the last data term.
    pub data: Planes<T>,
    /// How brightness was scaled.
    pub range: Range,
    /// What the windows were chosen by; `None` without sites.
    pub evidence: Option<Evidence<T>>,
    /// The same for a triple's change from step to step.
    pub change: Option<Evidence<T>>,
    /// How the motion was drawn before it was corrected.
    pub locking: Locking,
    /// The motion as it was on each coarser level, the finest of them first; none without covariance.
    pub above: Vec<Planes<T>>,
}

impl<T: SimdReal> Estimate<T> {
    /// All its planes.
    fn planes_mut(&mut self) -> impl Iterator<Item = &mut Planes<T>> {
        let evidence = self.evidence.iter_mut().chain(&mut self.change).flat_map(Evidence::planes_mut);
        evidence.chain(&mut self.above).chain([&mut self.motion, &mut self.data])
    }

    /// Gives back what only covariance and diagnostics rest on.
    fn forget_evidence(&mut self, workspace: &Workspace<T>) {
        let evidence = self.evidence.take().into_iter().chain(self.change.take());
        let above = std::mem::take(&mut self.above);
        evidence.flat_map(Evidence::into_planes).chain(above).for_each(|planes| workspace.space.keep(planes));
    }

    /// Gives its memory back.
    fn keep(mut self, workspace: &Workspace<T>) {
        self.forget_evidence(workspace);
        for planes in [self.motion, self.data] {
            workspace.space.keep(planes);
        }
    }
}
