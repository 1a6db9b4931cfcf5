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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::Frame;

    #[test]
    fn bytes_are_kept_and_other_types_are_stretched() {
        let bytes = AnyFrame::U8(Frame::from_fn(3, 1, |x, _| 7 * x as u8));
        assert_eq!(grey_picture(&bytes).pixel(2, 0), [14; 3]);
        let words = AnyFrame::U16(Frame::from_fn(2, 1, |x, _| 100 + 900 * x as u16));
        assert_eq!([0, 1].map(|x| grey_picture(&words).pixel(x, 0)[0]), [0, 255]);
        let flat = AnyFrame::F32(Frame::new(2, 1, vec![f32::NAN, 5.0]).unwrap());
        assert_eq!(grey_picture(&flat).pixel(0, 0), [0; 3]);
        let darker = AnyFrame::U16(Frame::filled(2, 1, 550));
        assert_eq!(GreyRange::of(&words).picture(&darker).pixel(0, 0), [128; 3]);
    }

    #[test]
    fn colours_share_one_range() {
        let bytes = AnyColourFrame::U8(Frame::filled(2, 1, [7, 0, 200]));
        assert_eq!(GreyRange::of_colour(&bytes).colour_picture(&bytes).pixel(1, 0), [7, 0, 200]);
        let floats = AnyColourFrame::F32(Frame::filled(2, 1, [0.25, 0.5, f32::NAN]));
        assert_eq!(GreyRange::of_colour(&floats).colour_picture(&floats).pixel(0, 0), [0, 255, 0]);
        let words = AnyColourFrame::U16(Frame::new(2, 1, vec![[100, 550, 1000]; 2]).unwrap());
        assert_eq!(GreyRange::of_colour(&words).colour_picture(&words).pixel(1, 0), [0, 128, 255]);
    }
}
