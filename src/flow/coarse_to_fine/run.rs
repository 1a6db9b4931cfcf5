//! From frames to a filled field: the pyramid, the iterations, the results.

use super::couple::{CoupleScratch, Coupling, couple};
use super::data::{DataOptions, DataTerm, MOTION};
use super::grid::Planes;
use super::levels::{PyramidLevel, pyramid};
use super::locking::Locking;
use super::options::{CoarseToFineOptions, Effort};
use super::output;
use super::refine::{Evidence, Options as Refinement, Space, refine};
use super::resample::{finer, rederive};
use crate::error::Result;
use crate::flow::options::Common;
use crate::simd::{Level, SimdReal};
use crate::types::{FlowField, Frame};

/// Noise is taken for at least this share of the brightness' standard deviation.
const LEAST_NOISE: f64 = 1e-3;
/// The scale of the robust weights is at least this share of the brightness' standard deviation.
const LEAST_SCALE: f64 = 4e-3;

/// The estimator behind the options.
#[derive(Debug)]
pub(in crate::flow) struct CoarseToFine {
    options: CoarseToFineOptions,
}

impl CoarseToFine {
    /// Checks the options.
    pub fn new(options: &CoarseToFineOptions) -> Result<Self> {
        options.check()?;
        Ok(Self { options: options.clone() })
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
            let range = Range::of(frames[0]);
            let levels = pyramid(common.level(), frames, range, common.mask.as_ref(), self.options.levels);
            let mut estimate = Descent::new(common.level(), self.options.preset.effort(), range).run(&levels);
            let (motion, evidence) =
                refine(common.level(), &mut Space::default(), &Refinement::default(), &estimate.motion, &estimate.data);
            (estimate.motion, estimate.evidence) = (motion, evidence);
            estimate.locking = Locking::measure(common.level(), &levels[0], &estimate.motion, estimate.scale);
            estimate.locking.correct(common.level(), &mut estimate.motion);
            output::fill(&estimate, frames, common, field);
        });
    }
}

/// The motion on the sites of the finest level, and what it rests on.
#[derive(Debug)]
pub(super) struct Estimate<T> {
    /// `u, v, u_x, v_x, u_y, v_y` on every second pixel, midway in time.
    pub motion: Planes<T>,
    /// The last data term.
    pub data: Planes<T>,
    /// How brightness was scaled.
    pub range: Range,
    /// Standard deviation of the residual.
    pub scale: Option<T>,
    /// What the windows were chosen by; `None` before.
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
    /// That of the first frame's finite samples: of the middle nine tenths of them, since a single no-data value may be as large as 1e9.
    fn of<T: SimdReal>(frame: &Frame<T>) -> Self {
        let every = (frame.data().len() / MOST_SAMPLES).max(1);
        let mut values: Vec<f64> = frame.data().iter().step_by(every).map(|value| value.to_f64()).collect();
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

/// The way from the coarsest level to the finest.
struct Descent<T> {
    simd: Level,
    effort: Effort,
    range: Range,
    term: DataTerm<T>,
    data: Planes<T>,
    /// Memory of the motion before the present one.
    spare: Planes<T>,
    scratch: CoupleScratch<T>,
    /// Standard deviation of what brightness changes by along the motion, from the iteration before.
    scale: Option<T>,
}

impl<T: SimdReal> Descent<T> {
    fn new(simd: Level, effort: Effort, range: Range) -> Self {
        Self {
            simd,
            effort,
            range,
            term: DataTerm::new(simd, DataOptions::default()),
            data: Planes::default(),
            spare: Planes::default(),
            scratch: CoupleScratch::default(),
            scale: None,
        }
    }

    fn run(mut self, levels: &[PyramidLevel<T>]) -> Estimate<T> {
        let mut motion: Option<Planes<T>> = None;
        for (k, level) in levels.iter().enumerate().rev() {
            let start = match &motion {
                Some(coarse) => finer(coarse, level.size),
                None => Planes::new(level.size.0.div_ceil(2), level.size.1.div_ceil(2), MOTION),
            };
            let (iterations, coupling) = self.effort.on_level(k);
            motion = Some((0..iterations).fold(start, |old, _| {
                let mut motion = std::mem::take(&mut self.spare);
                rederive(&old, &mut motion);
                self.spare = old;
                self.iterate(level, &coupling, motion)
            }));
        }
        let motion = motion.unwrap_or_else(|| Planes::new(0, 0, MOTION));
        Estimate {
            motion,
            data: self.data,
            range: self.range,
            scale: self.scale,
            evidence: None,
            locking: Locking::default(),
        }
    }

    /// One linearisation about `motion`, and the motion that follows from it.
    fn iterate(&mut self, level: &PyramidLevel<T>, coupling: &Coupling, mut motion: Planes<T>) -> Planes<T> {
        let residuals = self.term.linearise(level.size, &level.views(), &motion, self.scale, &mut self.data);
        self.scale = self.spread(residuals);
        let floor = T::from_f64((LEAST_NOISE * self.range.contrast).powi(2).max(f64::from(f32::MIN_POSITIVE)));
        couple(self.simd, &self.data, &mut motion, coupling, floor, &mut self.scratch);
        motion
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
