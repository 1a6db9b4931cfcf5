//! Frames as pictures.

use super::{Picture, percentile};
use crate::types::{AnyColourFrame, AnyFrame};

/// The samples that are shown as black and as white.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GreyRange {
    low: f64,
    gain: f64,
}

impl GreyRange {
    /// The range of a frame: for eight-bit samples all there is, for other types from their 0.5th to their
    /// 99.5th percentile, since sensors of 10 to 14 bit and float pictures say nothing of their full scale.
    /// The range of the first frame of a sequence serves for all of it, so that brightness can be compared.
    pub fn of(frame: &AnyFrame) -> Self {
        if matches!(frame, AnyFrame::U8(_)) {
            return Self { low: 0.0, gain: 1.0 };
        }
        Self::of_samples(frame.to_real::<f64>().data())
    }

    /// As [`GreyRange::of`], of all three components of a colour frame together.
    pub fn of_colour(frame: &AnyColourFrame) -> Self {
        if matches!(frame, AnyColourFrame::U8(_)) {
            return Self { low: 0.0, gain: 1.0 };
        }
        let samples: Vec<f64> = frame.scaled(1.0).data().as_flattened().iter().map(|v| f64::from(*v)).collect();
        Self::of_samples(&samples)
    }

    fn of_samples(samples: &[f64]) -> Self {
        let low = percentile(samples.iter().copied(), 0.5);
        let high = percentile(samples.iter().copied(), 99.5);
        Self { low, gain: if high > low { 255.0 / (high - low) } else { 0.0 } }
    }

    /// A picture of a colour frame in this range. NaN is black.
    pub fn colour_picture(&self, frame: &AnyColourFrame) -> Picture {
        let (width, height) = frame.size();
        if let AnyColourFrame::U8(frame) = frame {
            return Picture::from_fn(width, height, |x, y| frame.get(x, y));
        }
        let frame = frame.scaled(1.0);
        let shown = |sample: f32| ((f64::from(sample) - self.low) * self.gain).round() as u8;
        Picture::from_fn(width, height, |x, y| frame.get(x, y).map(shown))
    }

    /// A grey picture of a frame in this range. NaN is black.
    pub fn picture(&self, frame: &AnyFrame) -> Picture {
        let (width, height) = frame.size();
        if let AnyFrame::U8(frame) = frame {
            return Picture::from_fn(width, height, |x, y| [frame.get(x, y); 3]);
        }
        let frame = frame.to_real::<f64>();
        Picture::from_fn(width, height, |x, y| [((frame.get(x, y) - self.low) * self.gain).round() as u8; 3])
    }
}

/// A grey picture of a frame in its own [`GreyRange`].
pub fn grey_picture(frame: &AnyFrame) -> Picture {
    GreyRange::of(frame).picture(frame)
}
