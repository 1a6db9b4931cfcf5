//! Frames of any sample type on the scale that trackers think in: 8-bit grey levels.

use crate::types::{AnyFrame, Frame};

/// Brightest value of a float picture whose white is 1, with room for noise and overshoot.
const UNIT_WHITE: f64 = 1.5;
/// Share of the samples that may exceed it all the same: single pixels that are hot or damaged say nothing of the white.
const DAMAGED: f64 = 1e-3;

/// How samples become 8-bit grey levels (0 to 255, not rounded): thresholds of trackers (noise, contrast, gradient) are in these.
///
/// uint8 is taken as it is, uint16 is divided by 257, so that its white is 255 too. Floats say nothing of their white: if more than a thousandth of the first frame's finite
/// samples are above 1.5 they are grey levels already, else white is 1 and they are multiplied by 255. That is decided once, at the first frame, and kept: brightness must not jump.
///
/// A camera of 10 to 14 bit whose samples are not shifted up in their 16 bits comes out dark; it is to be scaled beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GreyLevels {
    /// What floats are multiplied by.
    float: f64,
}

impl GreyLevels {
    /// Decides by the first frame of a sequence.
    pub fn decide(first: &AnyFrame) -> Self {
        let levels = match first {
            AnyFrame::F32(frame) => exceed(frame.data().iter().map(|&value| f64::from(value))),
            AnyFrame::F64(frame) => exceed(frame.data().iter().copied()),
            AnyFrame::U8(_) | AnyFrame::U16(_) => true,
        };
        Self { float: if levels { 1.0 } else { 255.0 } }
    }

    /// Decides by frames of one moment, such as two views: by the first of them that is of floats, for the others' types say what white is.
    pub fn decide_together(frames: &[AnyFrame]) -> Self {
        let floats = frames.iter().find(|frame| matches!(frame, AnyFrame::F32(_) | AnyFrame::F64(_)));
        floats.or(frames.first()).map_or(Self { float: 1.0 }, Self::decide)
    }

    /// What the samples of a frame are multiplied by.
    pub fn gain(&self, frame: &AnyFrame) -> f64 {
        match frame {
            AnyFrame::U8(_) => 1.0,
            AnyFrame::U16(_) => 1.0 / 257.0,
            AnyFrame::F32(_) | AnyFrame::F64(_) => self.float,
        }
    }

    /// A frame in grey levels, as [`Tracker::update`](super::Tracker::update) takes it. NaN and infinities stay what they are.
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

/// Whether more samples exceed a white of 1 than can be damaged ones.
fn exceed(samples: impl Iterator<Item = f64>) -> bool {
    let (mut above, mut all) = (0usize, 0usize);
    for value in samples.filter(|value| value.is_finite()) {
        all += 1;
        above += usize::from(value > UNIT_WHITE);
    }
    above as f64 > DAMAGED * all as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn levels(first: &AnyFrame, frame: &AnyFrame) -> Vec<f64> {
        GreyLevels::decide(first).convert(frame).into_data()
    }

    #[test]
    fn white_is_255_for_every_type() {
        let bytes = AnyFrame::U8(Frame::new(3, 1, vec![0, 7, 255]).unwrap());
        let words = AnyFrame::U16(Frame::new(3, 1, vec![0, 7 * 257, 65535]).unwrap());
        let singles = AnyFrame::F32(Frame::new(3, 1, vec![0.0, 0.5, 1.0]).unwrap());
        assert_eq!(levels(&bytes, &bytes), [0.0, 7.0, 255.0]);
        for (got, want) in levels(&words, &words).into_iter().zip([0.0, 7.0, 255.0]) {
            assert!((got - want).abs() < 1e-12);
        }
        assert_eq!(levels(&singles, &singles), [0.0, 127.5, 255.0]);
    }

    #[test]
    fn floats_beside_bytes_decide_for_themselves() {
        let bytes = AnyFrame::U8(Frame::new(1, 1, vec![7]).unwrap());
        let (shares, grey) = (AnyFrame::F32(Frame::filled(1, 1, 0.5)), AnyFrame::F64(Frame::filled(1, 1, 50.0)));
        for (pair, white) in [([bytes.clone(), shares.clone()], 255.0), ([grey, shares], 1.0)] {
            let together = GreyLevels::decide_together(&pair);
            assert_eq!(together.convert(&pair[1]).into_data(), [0.5 * white]);
        }
        assert_eq!(GreyLevels::decide_together(std::slice::from_ref(&bytes)).convert(&bytes).into_data(), [7.0]);
    }

    #[test]
    fn single_damaged_samples_do_not_decide() {
        let with = |damaged: usize| {
            let frame = AnyFrame::F64(Frame::from_fn(100, 30, |x, y| if 100 * y + x < damaged { 2.0 } else { 0.5 }));
            levels(&frame, &frame)[2999]
        };
        assert_eq!([with(0), with(3), with(4)], [127.5, 127.5, 0.5]);
        let infinite = AnyFrame::F32(Frame::new(2, 1, vec![f32::INFINITY, 0.5]).unwrap());
        assert_eq!(levels(&infinite, &infinite)[1], 127.5);
    }

    #[test]
    fn the_first_frame_decides_for_floats() {
        let dark = AnyFrame::F64(Frame::new(2, 1, vec![f64::NAN, 1.2]).unwrap());
        let bright = AnyFrame::F64(Frame::new(2, 1, vec![1.0, 200.0]).unwrap());
        assert_eq!(levels(&bright, &dark)[1], 1.2);
        assert!(levels(&bright, &dark)[0].is_nan());
        assert_eq!(levels(&dark, &bright), [255.0, 51000.0]);
    }
}
