//! Options of the segmentation.

use crate::error::{Error, Result};

/// Options of [`felzenszwalb`](super::felzenszwalb); the defaults are scikit-image's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentOptions {
    /// The paper's `k`, levels times px: the larger, the larger the regions. Default 1.
    pub scale: f64,
    /// Standard deviation of the Gaussian before the segmentation, px; 0: none. Default 0.8, the paper's.
    pub sigma: f64,
    /// Smallest region, px; a region is smaller only if it is the whole image. Default 20.
    pub min_size: usize,
}

impl Default for SegmentOptions {
    fn default() -> Self {
        Self { scale: 1.0, sigma: 0.8, min_size: 20 }
    }
}

impl SegmentOptions {
    /// # Errors
    /// [`Error::Argument`] if `scale` or `sigma` is negative or not finite.
    pub fn check(&self) -> Result<()> {
        for (name, value) in [("scale", self.scale), ("sigma", self.sigma)] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(Error::argument(name, "a finite number, at least 0", value));
            }
        }
        Ok(())
    }
}
