//! The steps between a frame source and the frame memory: colour to grey, quantising, smoothing.

use super::{GaussianSmoother, Quantiser};
use crate::error::{Error, Result};
use crate::simd::SimdReal;
use crate::types::{Frame, Mask, Sample};

/// What is done to each frame first: quantise, then smooth (WO2010/098160, figure 1).
#[derive(Debug, Clone, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Preprocess {
    /// Rounding down to grey levels, as a camera does.
    pub quantise: Option<Quantiser>,
    /// Gaussian smoothing.
    pub smooth: Option<GaussianSmoother>,
    /// Pixels that may be used: smoothing takes the others for missing. Not saved.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub mask: Option<Mask>,
}

impl Preprocess {
    /// The frame after both steps; handed through untouched when there are none.
    ///
    /// [`Threads::install`](crate::parallel::Threads::install) chooses the number of threads.
    pub fn apply<T: SimdReal>(&self, frame: Frame<T>) -> Frame<T> {
        let frame = match &self.quantise {
            Some(quantiser) => quantiser.apply(&frame),
            None => frame,
        };
        match &self.smooth {
            Some(smoother) => smoother.apply(&self.without_masked(frame)),
            None => frame,
        }
    }

    /// NaN where the mask forbids; a mask of another size is for others to refuse.
    fn without_masked<T: SimdReal>(&self, mut frame: Frame<T>) -> Frame<T> {
        if let Some(mask) = self.mask.as_ref().filter(|mask| mask.size() == frame.size()) {
            for (value, usable) in frame.data_mut().iter_mut().zip(mask.data()) {
                if !usable {
                    *value = T::nan();
                }
            }
        }
        frame
    }
}

/// Weights of red, green and blue in luma (ITU-R BT.601).
const WEIGHTS: [f64; 3] = [0.299, 0.587, 0.114];

/// Luma `0.299 R + 0.587 G + 0.114 B` (ITU-R BT.601) of samples `[row][col][channel]`.
///
/// `channels` is 1 (grey), 2 (grey, alpha), 3 (RGB) or 4 (RGBA); alpha is left out. Integer luma is rounded
/// to the nearest level. A NaN in any colour channel makes its own pixel NaN and no other.
///
/// # Errors
/// [`Error::Argument`] for another number of channels, or when `data` does not hold `width * height *
/// channels` samples.
pub fn luminance<S: Sample>(width: usize, height: usize, channels: usize, data: &[S]) -> Result<Frame<S>> {
    if !(1..=4).contains(&channels) {
        return Err(Error::argument("channels", "1 (grey), 2 (grey, alpha), 3 (RGB) or 4 (RGBA)", channels));
    }
    if width.checked_mul(height).and_then(|n| n.checked_mul(channels)) != Some(data.len()) {
        let expected = format!("{width} x {height} x {channels} samples");
        return Err(Error::argument("data", expected, format!("{} samples", data.len())));
    }
    let pixels = data.chunks_exact(channels);
    let grey =
        if channels < 3 { pixels.map(|p| p[0]).collect() } else { pixels.map(|p| weigh([p[0], p[1], p[2]])).collect() };
    Frame::new(width, height, grey)
}

#[inline]
fn weigh<S: Sample>(rgb: [S; 3]) -> S {
    let [r, g, b] = rgb.map(S::to_real::<f64>);
    S::from_f64_nearest(WEIGHTS[0] * r + WEIGHTS[1] * g + WEIGHTS[2] * b)
}
