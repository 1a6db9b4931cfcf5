//! The steps between a frame source and the frame memory.

use super::{GaussianSmoother, Quantiser};
use crate::simd::SimdReal;
use crate::types::Frame;

/// What is done to each frame before estimation: quantise, then smooth (WO2010/098160, figure 1). Nothing by default.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Preprocess {
    /// Rounding down to grey levels, as a camera does.
    pub quantise: Option<Quantiser>,
    /// Gaussian smoothing.
    pub smooth: Option<GaussianSmoother>,
}

impl Preprocess {
    /// The frame after both steps; handed through untouched when there are none.
    ///
    /// Call it inside [`Threads::install`](crate::parallel::Threads::install) to choose the number of threads.
    pub fn apply<T: SimdReal>(&self, frame: Frame<T>) -> Frame<T> {
        let frame = match &self.quantise {
            Some(quantiser) => quantiser.apply(&frame),
            None => frame,
        };
        match &self.smooth {
            Some(smoother) => smoother.apply(&frame),
            None => frame,
        }
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
        let both = Preprocess { quantise: Some(quantise), smooth: Some(smooth) }.apply(frame.clone());
        assert_eq!(both, smooth.apply(&quantise.apply(&frame)));
        assert_ne!(both, quantise.apply(&smooth.apply(&frame)));
        assert_eq!(Preprocess::default().apply(frame.clone()), frame);
    }
}
