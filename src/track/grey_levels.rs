//! Frames of any sample type on the scale of the trackers' thresholds: 8-bit grey levels.

use crate::types::{AnyFrame, Frame};

/// Brightest value of a float picture whose white is 1, with room for noise and overshoot.
const UNIT_WHITE: f64 = 1.5;
/// Threshold of dark samples in a picture whose white is 1: black, noise, the overshoot of a filter.
const LIT: f64 = 0.1;
/// Grey levels that no overshoot of a white of 1 reaches.
const FAR_ABOVE: f64 = 16.0;
/// Maximum size of a sample that can be a brightness in any unit: above it the frame is damaged, and its sums
/// lose the other samples to rounding.
pub const GREATEST: f64 = 1e9;
/// Shares of the samples that may be hot or damaged: any at all, and those far above white.
const DAMAGED: [f64; 2] = [1e-3, 1e-2];

/// How samples become 8-bit grey levels (0 to 255, not rounded): thresholds of trackers (noise, contrast,
/// gradient) are in these.
///
/// uint8 is taken as it is, uint16 is divided by 257, so that its white is 255 too. Floats say nothing of
/// their white. It is taken for 1, and they are multiplied by 255, unless more than a thousandth of a frame's
/// samples up to 1e9 are above 1.5 and these are at least half of those that are not dark (above .1): then
/// they are grey levels already. Where less than a hundredth is not dark, most of what exceeds 1.5 must also
/// be above 16; and where what is above 16 is a hundredth of the frame and most of what exceeds 1.5, dim
/// surroundings do not matter. So patches of hot pixels decide nothing.
///
/// A sequence may begin with black frames, which do not decide: the first later frame of grey levels does
/// ([`revised`](Self::revised)). The reverse is excluded: brightness must not jump.
///
/// A camera of 10 to 14 bit whose samples are not shifted up in their 16 bits comes out dark; it is to be
/// scaled beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GreyLevels {
    /// What floats are multiplied by.
    float: f64,
}

impl GreyLevels {
    /// As long as no frame of floats has come: their white is taken for 1.
    pub fn of_integers() -> Self {
        Self { float: 255.0 }
    }

    /// Decides by the first frame of a sequence.
    pub fn decide(first: &AnyFrame) -> Self {
        Self::decide_together(std::slice::from_ref(first))
    }

    /// Decides by frames of one moment, such as two views: grey levels if one of floats holds them, for the
    /// others' types say what white is.
    pub fn decide_together(frames: &[AnyFrame]) -> Self {
        Self::of_integers().revised(frames)
    }

    /// The same after later frames of the sequence, which may show that floats are grey levels after all.
    pub fn revised(self, frames: &[AnyFrame]) -> Self {
        if self.float != 1.0 && frames.iter().any(holds_levels) { Self { float: 1.0 } } else { self }
    }

    /// As they were, from what [`GreyLevels::float_gain`] returned.
    pub fn of_floats(gain: f64) -> Self {
        Self { float: gain }
    }

    /// What floats are multiplied by.
    pub fn float_gain(self) -> f64 {
        self.float
    }

    /// What the samples of a frame are multiplied by.
    pub fn gain(&self, frame: &AnyFrame) -> f64 {
        match frame {
            AnyFrame::U8(_) => 1.0,
            AnyFrame::U16(_) => 1.0 / 257.0,
            AnyFrame::F32(_) | AnyFrame::F64(_) => self.float,
        }
    }

    /// A frame in grey levels, as [`Tracker::update`](super::Tracker::update) takes it. NaN and infinities
    /// stay what they are.
    pub fn convert(&self, frame: &AnyFrame) -> Frame<f64> {
        Self::scaled(frame.to_real(), self.gain(frame))
    }

    /// Samples multiplied by a gain; handed through untouched by a gain of 1.
    pub fn scaled(mut frame: Frame<f64>, gain: f64) -> Frame<f64> {
        if gain != 1.0 {
            frame.data_mut().iter_mut().for_each(|value| *value *= gain);
        }
        frame
    }
}

/// Whether a frame of floats holds grey levels.
fn holds_levels(frame: &AnyFrame) -> bool {
    match frame {
        AnyFrame::F32(frame) => are_levels(frame.data().iter().map(|&value| f64::from(value))),
        AnyFrame::F64(frame) => are_levels(frame.data().iter().copied()),
        AnyFrame::U8(_) | AnyFrame::U16(_) => false,
    }
}

/// Whether samples exceed a white of 1 by more than damaged ones do.
fn are_levels(samples: impl Iterator<Item = f64>) -> bool {
    let (mut all, mut lit, mut bright, mut high) = (0usize, 0usize, 0usize, 0usize);
    for value in samples.filter(|value| value.abs() <= GREATEST) {
        all += 1;
        lit += usize::from(value > LIT);
        bright += usize::from(value > UNIT_WHITE);
        high += usize::from(value > FAR_ABOVE);
    }
    let more_than = |share: f64, count: usize| count as f64 > share * all as f64;
    let mostly_high = 2 * high >= bright;
    let mostly_bright = 2 * bright >= lit && (more_than(DAMAGED[1], lit) || mostly_high);
    more_than(DAMAGED[0], bright) && (mostly_bright || mostly_high && more_than(DAMAGED[1], high))
}
