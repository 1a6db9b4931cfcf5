//! The range that brightness is brought to.

use crate::simd::SimdReal;
use crate::types::{Frame, Mask};

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
    pub fn of<T: SimdReal>(frame: &Frame<T>, mask: Option<&Mask>) -> Self {
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
