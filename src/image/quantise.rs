//! The quantiser in front of the smoother (WO2010/098160, figure 1).

use crate::error::{Error, Result};
use crate::math::Real;
use crate::parallel;
use crate::types::Frame;
use std::sync::atomic::{AtomicBool, Ordering};

/// Samples of a parallel task.
const PART: usize = 1 << 16;

/// Numbers from here on have no fraction.
const MAX_FRACTIONAL: f64 = (1u64 << 52) as f64;

/// Rounds samples down to a multiple of a step: `floor(x / step) * step`.
///
/// Step 1, the default, turns a computed brightness into the integer that a camera would report, as in
/// embodiment 2 of WO2010/098160. NaN and infinities stay as they are.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Quantiser {
    /// Distance between neighbouring levels, grey levels; default 1.
    pub step: f64,
}

impl Default for Quantiser {
    fn default() -> Self {
        Self { step: 1.0 }
    }
}

impl Quantiser {
    /// A quantiser with levels `step` grey levels apart.
    ///
    /// # Errors
    /// [`Error::Argument`] named `quantise` unless `step` is positive and finite.
    pub fn new(step: f64) -> Result<Self> {
        if !(step > 0.0 && step.is_finite()) {
            return Err(Error::argument("quantise", "a positive, finite step in grey levels", step));
        }
        Ok(Self { step })
    }

    /// The quantised frame. The quotient is taken in double precision, so `f32` levels are exact multiples.
    pub fn apply<T: Real>(&self, frame: &Frame<T>) -> Frame<T> {
        let step = self.step;
        if step == 1.0 {
            return frame.map(|x| T::from_f64(x.to_f64().floor()));
        }
        let quantised = |x: f64| {
            let steps = x / step;
            if steps.abs() < MAX_FRACTIONAL { steps.floor() * step } else { x }
        };
        frame.map(|x| T::from_f64(quantised(x.to_f64())))
    }
}

/// Whether the frames hold whole numbers of a scale with more than a few steps, as cameras give them:
/// rounding is then the least noise they can have.
pub(crate) fn are_rounded<T: Real>(frames: &[&Frame<T>]) -> bool {
    const STEPS: f64 = 8.0;
    let range = |frame: &&Frame<T>| {
        // One part that holds a fraction decides.
        let are_whole = AtomicBool::new(true);
        let of_part = |part: &[T]| {
            let range = are_whole.load(Ordering::Relaxed).then(|| whole_range(part)).flatten();
            are_whole.fetch_and(range.is_some(), Ordering::Relaxed);
            range
        };
        let both = |a: (f64, f64), b: Option<(f64, f64)>| b.map(|b| (a.0.min(b.0), a.1.max(b.1)));
        let parts = parallel::map(frame.data().chunks(PART), of_part);
        parts.into_iter().try_fold((f64::INFINITY, f64::NEG_INFINITY), both)
    };
    let ranges: Option<Vec<_>> = frames.iter().map(range).collect();
    ranges.is_some_and(|ranges| ranges.iter().any(|(least, most)| most - least >= STEPS))
}

/// The least and the greatest of the finite values; `None` if one is no whole number.
#[allow(clippy::needless_bitwise_bool)]
fn whole_range<T: Real>(values: &[T]) -> Option<(f64, f64)> {
    // Adding this rounds what is smaller to whole numbers; what is greater has no fraction in most formats.
    const ROUNDING: f64 = 1.5 * (1u64 << 52) as f64;
    let (mut least, mut most, mut are_whole) = (f64::INFINITY, f64::NEG_INFINITY, true);
    for value in values.iter().map(|value| value.to_f64()) {
        let is_finite = value.abs() < f64::INFINITY;
        // Without a short circuit, so that the compiler uses lanes.
        are_whole &= ((value + ROUNDING) - ROUNDING == value) | (value.abs() >= ROUNDING / 3.0) | value.is_nan();
        least = if is_finite & (value < least) { value } else { least };
        most = if is_finite & (value > most) { value } else { most };
    }
    are_whole.then_some((least, most))
}
