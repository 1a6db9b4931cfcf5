//! A frame as the tracker sees it: colour bins and grey levels.

use super::bins::colour_bins;
use crate::image::fill_holes;
use crate::parallel::for_each_band;
use crate::track::GreyLevels;
use crate::types::{AnyColourFrame, AnyFrame, ColourFrame, Frame, Sample};
use std::borrow::Cow;

/// Weights of red, green and blue in the brightness (ITU-R BT.601).
const LUMA: [f32; 3] = [0.299, 0.587, 0.114];

/// A frame in grey levels 0 to 255.
pub(super) struct View {
    pub colour: ColourFrame<f32>,
    pub bins: Frame<u8>,
    /// A smooth continuation where pixels are missing, so that corners nearby are seen.
    pub grey: Frame<f32>,
    /// Whether no pixel is finite: the frame shows nothing.
    pub is_empty: bool,
}

impl View {
    /// Converts a frame; `float_gain` is what samples of floats are multiplied by. `values`: pixels without
    /// hue have bins of value.
    pub fn new(frame: &AnyColourFrame, float_gain: f64, values: bool) -> Self {
        let colour = in_levels(frame, float_gain);
        let bins = colour_bins(&colour, values);
        let (width, height) = colour.size();
        let mut grey = Frame::filled(width, height, 0.0);
        for_each_band(grey.data_mut(), width, |_, rows, out| {
            for (out, [r, g, b]) in out.iter_mut().zip(&colour.data()[rows.start * width..rows.end * width]) {
                *out = LUMA[0] * r + LUMA[1] * g + LUMA[2] * b;
            }
        });
        let is_empty = !grey.data().iter().any(|value| value.is_finite());
        if let Cow::Owned(filled) = fill_holes(&grey, None) {
            grey = filled;
        }
        Self { colour, bins, grey, is_empty }
    }
}

/// What the floats of a sequence are multiplied by to be grey levels, after one more frame.
pub(super) fn revised(levels: GreyLevels, frame: &AnyColourFrame) -> GreyLevels {
    fn brightest<S: Sample>(frame: &ColourFrame<S>) -> [AnyFrame; 1] {
        [AnyFrame::F64(frame.map(|pixel| pixel.map(S::to_real::<f64>).into_iter().fold(f64::NAN, f64::max)))]
    }
    match frame {
        AnyColourFrame::U8(_) | AnyColourFrame::U16(_) => levels,
        AnyColourFrame::F32(frame) => levels.revised(&brightest(frame)),
        AnyColourFrame::F64(frame) => levels.revised(&brightest(frame)),
    }
}

/// A frame in grey levels.
pub(super) fn in_levels(frame: &AnyColourFrame, float_gain: f64) -> ColourFrame<f32> {
    frame.scaled(match frame {
        AnyColourFrame::U8(_) => 1.0,
        AnyColourFrame::U16(_) => 255.0 / u16::FULL_SCALE,
        AnyColourFrame::F32(_) | AnyColourFrame::F64(_) => float_gain,
    })
}
