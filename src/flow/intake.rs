//! Frames as every method takes them: masked samples at a neutral value, brightness of a usual magnitude.

use crate::simd::SimdReal;
use crate::types::{Frame, Mask};
use std::ops::RangeInclusive;

/// Magnitudes of brightness whose products neither overflow nor vanish in single precision.
const USUAL_MAGNITUDE: RangeInclusive<f64> = 1e-6..=1e7;
/// Binary exponent that other magnitudes are brought to: that of 8-bit frames.
const EXPONENT: f64 = 7.0;
/// Approximate number of samples that the magnitude is taken from.
const MAX_SAMPLES: usize = 4096;

/// Copies of frames that no method could take as they are.
pub(super) struct Intake<T> {
    pub frames: Vec<Frame<T>>,
    /// Power of two that brightness was multiplied by: scaling does not round.
    pub gain: f64,
}

impl<T: SimdReal> Intake<T> {
    /// The `frames` with masked samples, which may mark missing data by any number, replaced by a usual one;
    /// `None` if they can be taken as they are.
    pub fn of(frames: &[&Frame<T>], mask: Option<&Mask>) -> Option<Self> {
        let mask = mask.filter(|mask| mask.data().contains(&false));
        let is_used = |at: usize| mask.is_none_or(|mask| mask.data()[at]);
        let mut samples: Vec<f64> = Vec::new();
        for frame in frames {
            let places = (0..frame.data().len()).step_by((frames.len() * frame.data().len() / MAX_SAMPLES).max(1));
            let values = places.filter(|&at| is_used(at)).map(|at| frame.data()[at].to_f64());
            samples.extend(values.filter(|value| value.is_finite()));
        }
        // Pictures may be black but for a few spots.
        let mut sizes: Vec<f64> = samples.iter().map(|value| value.abs()).filter(|&size| size > 0.0).collect();
        let magnitude = middle(&mut sizes).unwrap_or(1.0);
        let gain =
            if USUAL_MAGNITUDE.contains(&magnitude) { 1.0 } else { (EXPONENT - magnitude.log2().floor()).exp2() };
        if mask.is_none() && gain == 1.0 {
            return None;
        }
        // One of the samples: frames of whole numbers stay such.
        let (neutral, factor) = (T::from_f64(middle(&mut samples).unwrap_or(0.0)), T::from_f64(gain));
        let taken = |frame: &&Frame<T>| {
            let mut out = (*frame).clone();
            for (at, value) in out.data_mut().iter_mut().enumerate() {
                *value = factor * if is_used(at) { *value } else { neutral };
            }
            out
        };
        Some(Self { frames: frames.iter().map(taken).collect(), gain })
    }
}

/// The middle one of some values.
fn middle(values: &mut [f64]) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
