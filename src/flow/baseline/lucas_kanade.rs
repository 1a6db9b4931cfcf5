//! Lucas and Kanade (1981): flow constant in a window, least squares.

use super::pair::Differences;
use crate::error::{Error, Result};
use crate::flow::options::Common;
use crate::simd::SimdReal;
use crate::types::{FlowField, Frame};

/// The weights of the window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Window {
    /// Gaussian of this standard deviation, px, cut off at three of them.
    Gaussian(f64),
    /// Square of this odd side, px, equal weights.
    Box(usize),
}

/// Options of the Lucas-Kanade baseline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LucasKanadeOptions {
    /// The window. Default: Gaussian, 4 px.
    pub window: Window,
    /// The frames differenced. Default: three.
    pub differences: Differences,
}

impl Default for LucasKanadeOptions {
    fn default() -> Self {
        Self { window: Window::Gaussian(4.0), differences: Differences::default() }
    }
}

/// The estimator behind the options.
#[derive(Debug)]
pub(in crate::flow) struct LucasKanade {
    options: LucasKanadeOptions,
}

impl LucasKanade {
    /// Checks the options.
    pub fn new(options: &LucasKanadeOptions, _common: &Common) -> Result<Self> {
        Ok(Self { options: *options })
    }
    /// Frames differenced.
    pub fn frames_needed(&self) -> usize {
        self.options.differences.frames()
    }
    /// The frame that the flow is filed under.
    pub fn frame(&self) -> usize {
        self.options.differences.frame()
    }
    /// Fills `field`, in px and frames.
    pub fn estimate_into<T: SimdReal>(
        &self,
        _frames: &[&Frame<T>],
        _common: &Common,
        _field: &mut FlowField<T>,
    ) -> Result<()> {
        Err(Error::Missing("method: Lucas-Kanade is not part of this build".into()))
    }
}
