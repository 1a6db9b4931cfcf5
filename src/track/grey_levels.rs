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
    /// Decides by the first frame of a sequence.
    pub fn decide(first: &AnyFrame) -> Self {
        Self::decide_together(std::slice::from_ref(first))
    }

    /// Decides by frames of one moment, such as two views: grey levels if one of floats holds them, for the
    /// others' types say what white is.
    pub fn decide_together(frames: &[AnyFrame]) -> Self {
        Self { float: 255.0 }.revised(frames)
    }

    /// The same after later frames of the sequence, which may show that floats are grey levels after all.
    pub fn revised(self, frames: &[AnyFrame]) -> Self {
        if self.float != 1.0 && frames.iter().any(holds_levels) { Self { float: 1.0 } } else { self }
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

    /// What .5 in the last of 320 x 240 pixels becomes, where `shown` says what is in the others.
    fn beside(shown: impl Fn(usize, usize) -> f64) -> f64 {
        let frame =
            AnyFrame::F64(Frame::from_fn(320, 240, |x, y| if (x, y) == (319, 239) { 0.5 } else { shown(x, y) }));
        levels(&frame, &frame)[320 * 240 - 1]
    }

    #[test]
    fn hot_patches_do_not_decide() {
        for (side, hot) in [(1, 2.0), (9, 1.6), (9, 200.0), (27, 1.6), (80, 1.6)] {
            let inside = |x: usize, y: usize| x < side && y < side;
            assert_eq!(beside(|x, y| if inside(x, y) { hot } else { 0.2 + 0.002 * x as f64 }), 127.5, "{side} {hot}");
        }
        // On black a small patch decides if it is far above white: a small object rather than hot pixels.
        let inside = |x: usize, y: usize| x < 9 && y < 9;
        assert_eq!(beside(|x, y| if inside(x, y) { 1.6 } else { 0.0 }), 127.5);
        assert_eq!(beside(|x, y| if inside(x, y) { 160.0 } else { 0.0 }), 0.5);
        let infinite = AnyFrame::F32(Frame::new(2, 1, vec![f32::INFINITY, 0.5]).unwrap());
        assert_eq!(levels(&infinite, &infinite)[1], 127.5);
    }

    #[test]
    fn grey_levels_are_known_in_the_dark_too() {
        let away = |x: usize, y: usize| ((x as f64 - 160.0).powi(2) + (y as f64 - 120.0).powi(2)) / 50.0;
        // A smooth spot on black, a small bright object before a dim background, and a dim picture.
        assert_eq!(beside(|x, y| 200.0 * (-away(x, y)).exp()), 0.5);
        assert_eq!(beside(|x, y| if away(x, y) < 9.0 { 180.0 } else { 0.7 }), 0.5);
        assert_eq!(beside(|x, _| 1.0 + 0.02 * x as f64), 0.5);
    }

    #[test]
    fn a_film_that_begins_with_black_has_the_scale_of_what_follows() {
        let frame =
            |gain: f64| AnyFrame::F32(Frame::from_fn(64, 48, |x, y| (gain * ((7 * x + 13 * y) % 256) as f64) as f32));
        for black in [0.0, 0.005] {
            let begun = GreyLevels::decide(&frame(black));
            let gain = |later: &AnyFrame| begun.revised(std::slice::from_ref(later)).gain(later);
            assert_eq!(gain(&frame(1.0)), 1.0, "{black}");
            assert_eq!(gain(&frame(1.0 / 255.0)), 255.0, "{black}");
        }
        // What is known to be grey levels stays it, however dark.
        let known = GreyLevels::decide(&frame(1.0)).revised(&[frame(0.005)]);
        assert_eq!(known.gain(&frame(0.005)), 1.0);
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
