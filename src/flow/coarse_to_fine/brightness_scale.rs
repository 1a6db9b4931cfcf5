//! Scaling of brightness, so that constants hold for 8-bit, 16-bit and floating-point frames alike.

use crate::simd::SimdReal;
use crate::types::{Frame, Mask};

/// Standard deviation that brightness is scaled to, grey levels: about that of 8-bit pictures.
const TARGET_STD: f64 = 40.0;

/// Minimum standard deviation of a residual, as a share of that of the brightness (rounding).
pub(super) const MIN_RESIDUAL_SHARE: f64 = 4e-3;
/// Approximate maximum number of samples used.
const MAX_SAMPLES: usize = 20_000;
/// Maximum scaled brightness; beyond it a sample marks missing data.
const MAX_SCALED_BRIGHTNESS: f64 = 1e6;

/// Minimum standard deviation over the trimmed extent: a tenth of that of a uniform distribution.
const MIN_STD_OVER_EXTENT: f64 = 0.03;
/// One in so many samples is trimmed at either end of the extent.
const TRIMMED_FRACTION_DIVISOR: usize = 200;
/// Minimum standard deviation over the mean; less is rounding.
const MIN_STD_OVER_MEAN: f64 = 1e-12;

/// Extent of the `values` without the outermost and repeated extreme ones (missing data); reorders them.
fn trimmed_extent(values: &mut [f64]) -> f64 {
    let (low, high) = values.iter().fold((f64::MAX, f64::MIN), |(low, high), &v| (low.min(v), high.max(v)));
    let repeated = |extreme: f64| Some(values.iter().filter(|v| **v == extreme).count()).filter(|&count| count > 1);
    let (start, end) = (repeated(low).unwrap_or(0), values.len() - repeated(high).unwrap_or(0));
    if start >= end {
        return 0.0;
    }
    let cut = (end - start) / TRIMMED_FRACTION_DIVISOR;
    let mut place = |at: usize| *values.select_nth_unstable_by(at, f64::total_cmp).1;
    place(end - 1 - cut) - place(start + cut)
}

/// Scaling of brightness: `(brightness - mean) gain`.
#[derive(Debug, Clone, Copy)]
pub(super) struct BrightnessScale {
    pub mean: f64,
    /// A power of two, so that scaling does not round; 1 for frames without contrast.
    pub gain: f64,
    /// Standard deviation of the scaled brightness.
    pub contrast: f64,
}

impl BrightnessScale {
    /// From the finite, unmasked samples: their middle nine tenths, since a single no-data value may be 1e9,
    /// but at least a share of the trimmed extent, since pictures may be dark but for a few spots.
    pub fn of<T: SimdReal>(frames: &[&Frame<T>], mask: Option<&Mask>) -> Self {
        Self::of_samples(frames, mask, MAX_SAMPLES)
    }

    /// The same from about so many samples at most.
    pub fn of_samples<T: SimdReal>(frames: &[&Frame<T>], mask: Option<&Mask>, max_samples: usize) -> Self {
        let allowed = |at: usize| mask.is_none_or(|mask| mask.data().get(at).copied().unwrap_or(true));
        let mut values: Vec<f64> = Vec::new();
        for frame in frames {
            let stride = (frames.len() * frame.data().len() / max_samples).max(1);
            let places = (0..frame.data().len()).step_by(stride).filter(|&at| allowed(at));
            values.extend(places.map(|at| frame.data()[at].to_f64()).filter(|value| value.is_finite()));
        }
        if values.is_empty() {
            return Self { mean: 0.0, gain: 1.0, contrast: 0.0 };
        }
        let extent = trimmed_extent(&mut values);
        let (cut, count) = (values.len() / 20, values.len());
        if cut > 0 {
            values.select_nth_unstable_by(cut, f64::total_cmp);
            values[cut..].select_nth_unstable_by(count - 2 * cut, f64::total_cmp);
        }
        let middle = &values[cut..count - cut];
        let mean = middle.iter().sum::<f64>() / middle.len() as f64;
        let deviation = |values: &[f64]| {
            (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
        };
        let robust = deviation(middle).max(MIN_STD_OVER_EXTENT * extent);
        // A picture with a single small spot has no other contrast.
        let deviation = Some(robust).filter(|&d| d > 0.0).unwrap_or_else(|| deviation(&values));
        let deviation = if deviation > MIN_STD_OVER_MEAN * mean.abs() { deviation } else { 0.0 };
        let gain = (TARGET_STD / deviation).log2().round().exp2();
        let gain = if gain.is_finite() && gain > 0.0 { gain } else { 1.0 };
        Self { mean, gain, contrast: gain * deviation }
    }

    /// Whether a sample is brightness and not a mark for missing data.
    pub fn holds(&self, value: f64) -> bool {
        ((value - self.mean) * self.gain).abs() < MAX_SCALED_BRIGHTNESS
    }
}
