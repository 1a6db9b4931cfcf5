//! From frames to a filled field: the pyramid, the iterations, the results.

use super::couple::{CoupleScratch, Coupling, couple};
use super::data::{DataOptions, DataTerm, MOTION};
use super::grid::Planes;
use super::levels::PyramidLevel;
use super::locking::Locking;
use super::memory::{Memory, Workspace};
use super::options::{CoarseToFineOptions, Effort};
use super::output;
use super::refine::{Evidence, Options as Refinement, refine};
use super::resample::{finer, rederive};
use crate::error::Result;
use crate::flow::options::Common;
use crate::simd::{Level, SimdReal};
use crate::types::{FlowField, Frame, Mask};

/// Noise is taken for at least this share of the brightness' standard deviation.
const LEAST_NOISE: f64 = 1e-3;
/// The scale of the robust weights is at least this share of the brightness' standard deviation.
const LEAST_SCALE: f64 = 4e-3;

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
            let level = workspace.pyramid.fill(simd, frames, range, common.mask.as_ref(), levels);
            let (coupled, scale) = descend(simd, &effort, range, level, &mut workspace);
            let Workspace { pyramid, data, space, .. } = &mut *workspace;
            let (mut motion, evidence) = refine(simd, space, &Refinement::default(), &coupled, data);
            space.keep(coupled);
            let locking = Locking::measure(simd, &pyramid.levels()[level], &motion, scale);
            locking.correct(simd, &mut motion);
            let estimate = Estimate { level, motion, data, range, evidence, locking };
            output::fill(&estimate, space, frames, common, field);
            space.keep(estimate.motion);
            estimate.evidence.into_iter().flat_map(Evidence::into_planes).for_each(|planes| space.keep(planes));
            self.memory.give(workspace);
        });
    }
}

/// The motion on the sites of the finest level worked on, and what it rests on.
#[derive(Debug)]
pub(super) struct Estimate<'a, T> {
    /// The level of the pyramid that all lengths are in pixels of.
    pub level: usize,
    /// `u, v, u_x, v_x, u_y, v_y` on every second pixel, midway in time.
    pub motion: Planes<T>,
    /// The last data term.
    pub data: &'a Planes<T>,
    /// How brightness was scaled.
    pub range: Range,
    /// What the windows were chosen by; `None` without sites.
    pub evidence: Option<Evidence<T>>,
    /// How the motion was drawn before it was corrected.
    pub locking: Locking,
}

/// Standard deviation that brightness is scaled to, about that of 8-bit pictures: what is small or large is then the same for frames of every range.
const CONTRAST: f64 = 40.0;

/// Samples that the range is taken from, about.
const MOST_SAMPLES: usize = 20_000;
/// Scaled brightness beyond which a sample is no brightness but a mark for missing data.
const NO_DATA: f64 = 1e6;

/// How brightness is brought to a common range: `(brightness - mean) gain`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Range {
    pub mean: f64,
    /// A power of two, so that it rounds nothing; 1 for frames without contrast.
    pub gain: f64,
    /// Standard deviation of the brightness afterwards.
    pub contrast: f64,
}

impl Range {
    /// That of the first frame's finite samples that may be used: of the middle nine tenths of them, since a single no-data value may be as large as 1e9.
    fn of<T: SimdReal>(frame: &Frame<T>, mask: Option<&Mask>) -> Self {
        let every = (frame.data().len() / MOST_SAMPLES).max(1);
        let allowed = |at: usize| mask.is_none_or(|mask| mask.data().get(at).copied().unwrap_or(true));
        let places = (0..frame.data().len()).step_by(every).filter(|&at| allowed(at));
        let mut values: Vec<f64> = places.map(|at| frame.data()[at].to_f64()).collect();
        values.retain(|value| value.is_finite());
        if values.is_empty() {
            return Self { mean: 0.0, gain: 1.0, contrast: 0.0 };
        }
        values.sort_unstable_by(f64::total_cmp);
        let cut = values.len() / 20;
        let middle = &values[cut..values.len() - cut];
        let mean = middle.iter().sum::<f64>() / middle.len() as f64;
        let deviation = |values: &[f64]| {
            (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
        };
        // A picture that is dark but for a few spots has nothing in the middle.
        let deviation = Some(deviation(middle)).filter(|&d| d > 0.0).unwrap_or_else(|| deviation(&values));
        let gain = (CONTRAST / deviation).log2().round().exp2();
        let gain = if gain.is_finite() && gain > 0.0 { gain } else { 1.0 };
        Self { mean, gain, contrast: gain * deviation }
    }

    /// Whether a sample can be brightness at all.
    pub fn holds(&self, value: f64) -> bool {
        ((value - self.mean) * self.gain).abs() < NO_DATA
    }
}

/// The way from the coarsest level of the filled pyramid to the level `last`: the coupled motion there with the standard deviation of the residual, and in the
/// workspace the last data term.
fn descend<T: SimdReal>(
    simd: Level,
    effort: &Effort,
    range: Range,
    last: usize,
    workspace: &mut Workspace<T>,
) -> (Planes<T>, Option<T>) {
    let Workspace { pyramid, data, pool, scratch, space } = workspace;
    let mut step =
        Step { simd, range, term: DataTerm::new(simd, DataOptions::default(), pool), data, scratch, scale: None };
    let mut motion = space.planes(0, 0, MOTION);
    let mut old = space.planes(0, 0, MOTION);
    for (k, level) in pyramid.levels().iter().enumerate().skip(last).rev() {
        if k + 1 == pyramid.levels().len() {
            motion.reshape(level.size.0.div_ceil(2), level.size.1.div_ceil(2), MOTION);
            motion.data_mut().fill(T::from_f64(0.0));
        } else {
            std::mem::swap(&mut motion, &mut old);
            finer(simd, &old, level.size, &mut motion);
        }
        let (iterations, coupling) = effort.on_level(k, level.size, k + 1 == pyramid.levels().len());
        for _ in 0..iterations {
            std::mem::swap(&mut motion, &mut old);
            rederive(&old, &mut motion);
            step.iterate(level, &coupling, &mut motion);
        }
    }
    space.keep(old);
    (motion, step.scale)
}

/// One linearisation, and the motion that follows from it.
struct Step<'a, T> {
    simd: Level,
    range: Range,
    term: DataTerm<'a, T>,
    data: &'a mut Planes<T>,
    scratch: &'a mut CoupleScratch<T>,
    /// Standard deviation of what brightness changes by along the motion, from the iteration before.
    scale: Option<T>,
}

impl<T: SimdReal> Step<'_, T> {
    /// Linearises about `motion` and moves it.
    fn iterate(&mut self, level: &PyramidLevel<T>, coupling: &Coupling, motion: &mut Planes<T>) {
        let residuals = self.term.linearise(level.size, &level.views(), motion, self.scale, self.data);
        self.scale = self.spread(residuals);
        let floor = T::from_f64((LEAST_NOISE * self.range.contrast).powi(2).max(f64::from(f32::MIN_POSITIVE)));
        couple(self.simd, self.data, motion, coupling, floor, self.scratch);
    }

    /// Robust standard deviation of residuals whose magnitudes these are.
    fn spread(&self, mut residuals: Vec<T>) -> Option<T> {
        if residuals.is_empty() {
            return None;
        }
        let middle = residuals.len() / 2;
        residuals.select_nth_unstable_by(middle, |a, b| a.to_f64().total_cmp(&b.to_f64()));
        let least = (LEAST_SCALE * self.range.contrast).max(f64::from(f32::MIN_POSITIVE));
        Some(T::from_f64(1.4826 * residuals[middle].to_f64() + least))
    }
}
