//! From frames to a filled field: the pyramid, the iterations, the results.

use super::data::{COUNT, MOTION};
use super::descend::Plan;
use super::grid::Planes;
use super::levels::Compared;
use super::locking::Locking;
use super::memory::{Memory, Workspace};
use super::options::CoarseToFineOptions;
use super::output;
use super::range::Range;
use super::refine::{Evidence, Options as Refinement, refine};
use crate::error::Result;
use crate::flow::options::Common;
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
    pub fn estimate_into<T: SimdReal>(&self, frames: &[&Frame<T>], common: &Common, field: &mut FlowField<T>) {
        common.threads.install(|| {
            let simd = common.level();
            let range = Range::of(frames[0], common.mask.as_ref());
            let mut workspace = self.memory.take::<T>();
            let effort = self.options.preset.effort();
            let levels = (self.options.levels, effort.last);
            let last = workspace.pyramid.fill(simd, frames, range, common.mask.as_ref(), levels);
            let plan = Plan { simd, effort, range, last };
            let estimate = estimate(&plan, frames.len() == 3, &mut workspace);
            output::fill(&estimate, &workspace.space, frames, common, field);
            estimate.keep(&mut workspace);
            self.memory.give(workspace);
        });
    }
}

/// From the filled pyramid to the motion.
fn estimate<T: SimdReal>(plan: &Plan, is_triple: bool, workspace: &mut Workspace<T>) -> Estimate<T> {
    let (simd, last) = (plan.simd, plan.last);
    let (mut coupled, scale) = plan.from_nothing(workspace);
    let Workspace { pyramid, data, space, .. } = &mut *workspace;
    let (mut motion, evidence) = refine(simd, space, &Refinement::default(), &coupled, data);
    let locking = Locking::measure(simd, (&pyramid.levels()[last], Compared::All), &motion, scale);
    locking.correct(simd, &mut motion);
    let data = std::mem::take(data);
    let change = is_triple.then(|| {
        workspace.data = workspace.space.planes(data.width, data.height, COUNT);
        locking.correct(simd, &mut coupled);
        change(plan, workspace, &coupled, &mut motion)
    });
    workspace.space.keep(coupled);
    Estimate { level: last, motion, data, range: plan.range, evidence, change: change.flatten(), locking }
}

/// Adds to a triple's `motion`, the mean of both steps, what the step to the next frame alone differs by from the `coupled` motion: the flow then tells where the middle
/// frame's pixels are in the next, whether or not they go on as they came. What noise explains is nothing.
fn change<T: SimdReal>(
    plan: &Plan,
    workspace: &mut Workspace<T>,
    coupled: &Planes<T>,
    motion: &mut Planes<T>,
) -> Option<Evidence<T>> {
    let (simd, last) = (plan.simd, plan.last);
    let (mut ahead, scale) = plan.ahead(workspace, coupled);
    let Workspace { pyramid, data, space, .. } = workspace;
    let locking = Locking::measure(simd, (&pyramid.levels()[last], Compared::Ahead), &ahead, scale);
    locking.correct(simd, &mut ahead);
    ahead.data_mut().iter_mut().zip(coupled.data()).for_each(|(ahead, both)| *ahead = *ahead - *both);
    let (change, evidence) = refine(simd, space, &Refinement::for_changes(), &ahead, data);
    for (y, k) in (0..motion.height).flat_map(|y| (0..MOTION).map(move |k| (y, k))) {
        motion.line_mut(k, y).iter_mut().zip(change.line(k, y)).for_each(|(sum, change)| *sum = *sum + *change);
    }
    [ahead, change].into_iter().for_each(|planes| space.keep(planes));
    evidence
}

/// The motion on the sites of the finest level worked on, and what it rests on.
#[derive(Debug)]
pub(super) struct Estimate<T> {
    /// The level of the pyramid that all lengths are in pixels of.
    pub level: usize,
    /// `u, v, u_x, v_x, u_y, v_y` on every second pixel: of a pair midway in time, of a triple at the middle frame.
    pub motion: Planes<T>,
    /// The last data term.
    pub data: Planes<T>,
    /// How brightness was scaled.
    pub range: Range,
    /// What the windows were chosen by; `None` without sites.
    pub evidence: Option<Evidence<T>>,
    /// The same for a triple's change from step to step.
    pub change: Option<Evidence<T>>,
    /// How the motion was drawn before it was corrected.
    pub locking: Locking,
}

impl<T: SimdReal> Estimate<T> {
    /// Gives its memory back.
    fn keep(self, workspace: &mut Workspace<T>) {
        let evidence = self.evidence.into_iter().chain(self.change).flat_map(Evidence::into_planes);
        let data = std::mem::replace(&mut workspace.data, self.data);
        evidence.chain([self.motion, data]).for_each(|planes| workspace.space.keep(planes));
    }
}
