//! The steps between a frame source and the frame memory.

use super::{GaussianSmoother, Quantiser};
use crate::simd::SimdReal;
use crate::types::{Frame, Mask};

/// What is done to each frame before estimation: quantise, then smooth (WO2010/098160, figure 1). Nothing by
/// default.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Preprocess {
    /// Rounding down to grey levels, as a camera does.
    pub quantise: Option<Quantiser>,
    /// Gaussian smoothing.
    pub smooth: Option<GaussianSmoother>,
    /// Pixels that may be used: smoothing takes the others for missing.
    pub mask: Option<Mask>,
}

impl Preprocess {
    /// The frame after both steps; handed through untouched when there are none.
    ///
    /// Call it inside [`Threads::install`](crate::parallel::Threads::install) to choose the number of
    /// threads.
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

    /// Changes nothing.
    pub fn is_identity(&self) -> bool {
        self.quantise.is_none() && self.smooth.is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantising_comes_before_smoothing() {
        let frame = Frame::from_fn(9, 7, |x, y| 0.3 * x as f64 + 0.7 * y as f64);
        let (quantise, smooth) = (Quantiser::default(), GaussianSmoother::new(1.0).unwrap());
        let both = Preprocess { quantise: Some(quantise), smooth: Some(smooth), mask: None }.apply(frame.clone());
        assert_eq!(both, smooth.apply(&quantise.apply(&frame)));
        assert_ne!(both, quantise.apply(&smooth.apply(&frame)));
        assert_eq!(Preprocess::default().apply(frame.clone()), frame);
    }

    #[test]
    fn what_a_mask_forbids_is_never_smoothed_in() {
        let mask = Some(Frame::from_fn(15, 13, |x, y| (x, y) != (7, 6)));
        let steps = Preprocess { smooth: Some(GaussianSmoother::new(0.5).unwrap()), mask, ..Preprocess::default() };
        let frame = |hidden: f64| Frame::from_fn(15, 13, |x, y| if (x, y) == (7, 6) { hidden } else { x as f64 });
        let (a, b) = (steps.apply(frame(0.0)), steps.apply(frame(1e6)));
        assert!(a.data().iter().zip(b.data()).all(|(a, b)| a.to_bits() == b.to_bits()));
        assert!(a.get(7, 6).is_nan() && a.get(6, 6).is_nan() && a.get(1, 1).is_finite());
    }
}
