//! The steps between a frame source and the frame memory.

use super::{GaussianSmoother, Quantiser};
use crate::simd::SimdReal;
use crate::types::{Frame, Mask};

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
