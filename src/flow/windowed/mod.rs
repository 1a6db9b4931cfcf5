//! The windowed affine estimate.

use super::options::Common;
use crate::error::{Error, Result};
use crate::jet::TimeScheme;
use crate::simd::SimdReal;
use crate::types::{FlowField, Frame};

/// Options of the windowed estimate.
#[derive(Debug, Clone, PartialEq)]
pub struct WindowedOptions {
    /// Standard deviation of the Gaussian window, px. Default 4.
    pub sigma: f64,
    /// Time differences. Default central.
    pub scheme: TimeScheme,
}

impl Default for WindowedOptions {
    fn default() -> Self {
        Self { sigma: 4.0, scheme: TimeScheme::default() }
    }
}

/// The estimator behind the options.
#[derive(Debug)]
pub(super) struct Windowed {
    scheme: TimeScheme,
}

impl Windowed {
    /// Checks the options.
    pub fn new(options: &WindowedOptions, _common: &Common) -> Result<Self> {
        if !(options.sigma.is_finite() && options.sigma > 0.0) {
            return Err(Error::argument("sigma", "a positive number of px", options.sigma));
        }
        Ok(Self { scheme: options.scheme })
    }

    /// Which of the three frames the estimate belongs to.
    pub fn frame(&self) -> usize {
        self.scheme.frame()
    }

    /// Fills `field` (in px and frames; the caller converts to physical units). `frames`: three of one size, oldest first.
    #[allow(clippy::unused_self)]
    pub fn estimate_into<T: SimdReal>(
        &self,
        _frames: &[&Frame<T>],
        _common: &Common,
        _field: &mut FlowField<T>,
    ) -> Result<()> {
        Err(Error::Missing("method: the windowed estimate is not part of this build".into()))
    }
}
