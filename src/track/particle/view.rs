//! A frame as the tracker sees it: colour bins and grey levels.

use super::bins::colour_bins;
use crate::parallel::for_each_band;
use crate::track::GreyLevels;
use crate::types::{AnyColourFrame, AnyFrame, ColourFrame, Frame, Sample};

/// Weights of red, green and blue in the brightness (ITU-R BT.601).
const LUMA: [f32; 3] = [0.299, 0.587, 0.114];

/// A frame in grey levels 0 to 255.
pub(super) struct View {
    pub colour: ColourFrame<f32>,
    pub bins: Frame<u8>,
    pub grey: Frame<f32>,
}

impl View {
    /// Converts a frame. `values`: pixels without hue have bins of value.
    pub fn new(frame: &AnyColourFrame, gain: f64, values: bool) -> Self {
        let colour = frame.scaled(gain);
        let bins = colour_bins(&colour, values);
        let (width, height) = colour.size();
        let mut grey = Frame::filled(width, height, 0.0);
        for_each_band(grey.data_mut(), width, |_, rows, out| {
            for (out, [r, g, b]) in out.iter_mut().zip(&colour.data()[rows.start * width..rows.end * width]) {
                *out = LUMA[0] * r + LUMA[1] * g + LUMA[2] * b;
            }
        });
        Self { colour, bins, grey }
    }

    /// Whether no pixel is finite: the frame shows nothing.
    pub fn is_empty(&self) -> bool {
        !self.grey.data().iter().any(|value| value.is_finite())
    }
}

/// What the samples of a sequence are multiplied by to be grey levels, decided by its first frame.
pub(super) fn level_gain(frame: &AnyColourFrame) -> f64 {
    fn brightest<S: Sample>(frame: &ColourFrame<S>) -> AnyFrame {
        AnyFrame::F64(frame.map(|pixel| pixel.map(S::to_real::<f64>).into_iter().fold(f64::NAN, f64::max)))
    }
    match frame {
        AnyColourFrame::U8(_) => 1.0,
        AnyColourFrame::U16(_) => 255.0 / u16::FULL_SCALE,
        AnyColourFrame::F32(frame) => {
            let first = brightest(frame);
            GreyLevels::decide(&first).gain(&first)
        }
        AnyColourFrame::F64(frame) => {
            let first = brightest(frame);
            GreyLevels::decide(&first).gain(&first)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sample_types_give_the_same_levels() {
        let value = |x: usize, y: usize, c: usize| ((37 * x + 61 * y + 91 * c) % 256) as u8;
        let bytes = Frame::from_fn(40, 30, |x, y| [0, 1, 2].map(|c| value(x, y, c)));
        let words = bytes.map(|p| p.map(|s| u16::from(s) * 257));
        let shares = bytes.map(|p| p.map(|s| f32::from(s) / 255.0));
        let levels = bytes.map(|p| p.map(f64::from));
        let want = View::new(&AnyColourFrame::U8(bytes.clone()), 1.0, true);
        for frame in [AnyColourFrame::U16(words), AnyColourFrame::F32(shares), AnyColourFrame::F64(levels)] {
            let view = View::new(&frame, level_gain(&frame), true);
            let same = view.bins.data().iter().zip(want.bins.data()).filter(|(a, b)| a == b).count();
            // A bin's edge may fall to either side by rounding.
            assert!(same > 1190, "{} {same}", frame.dtype());
            assert!(view.grey.data().iter().zip(want.grey.data()).all(|(a, b)| (a - b).abs() < 1e-3));
        }
        let nothing = AnyColourFrame::F32(Frame::filled(8, 8, [f32::NAN; 3]));
        assert!(View::new(&nothing, 1.0, true).is_empty() && !want.is_empty());
    }
}
