//! Horn and Schunck (1981): globally smooth flow.

use super::pair::Differences;
use crate::error::{Error, Result};
use crate::flow::options::Common;
use crate::simd::SimdReal;
use crate::types::{FlowField, Frame};

/// The smoothness weight g of the energy `sum (Ix u + Iy v + It)^2 + g^2 (|grad u|^2 + |grad v|^2)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Smoothness {
    /// In units of the frame's root mean square gradient, so that the flow does not depend on the intensity gain.
    Relative(f64),
    /// In grey levels per px.
    Absolute(f64),
}

/// Options of the Horn-Schunck baseline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HornSchunckOptions {
    /// Smoothness weight. Default: the root mean square gradient.
    pub smoothness: Smoothness,
    /// The linear system is solved to this relative residual. Default 1e-6.
    pub tolerance: f64,
    /// Most iterations; an error when they do not suffice. Default 5000.
    pub iterations: usize,
    /// The frames differenced. Default: three.
    pub differences: Differences,
}

impl Default for HornSchunckOptions {
    fn default() -> Self {
        Self {
            smoothness: Smoothness::Relative(1.0),
            tolerance: 1e-6,
            iterations: 5000,
            differences: Differences::default(),
        }
    }
}

/// The estimator behind the options.
#[derive(Debug)]
pub(in crate::flow) struct HornSchunck {
    options: HornSchunckOptions,
}

impl HornSchunck {
    /// Checks the options.
    pub fn new(options: &HornSchunckOptions, _common: &Common) -> Result<Self> {
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
        Err(Error::Missing("method: Horn-Schunck is not part of this build".into()))
    }
}
