//! Options that all estimators share.

use crate::error::{Error, Result};
use crate::parallel::Threads;
use crate::simd::Level;
use crate::types::{Frame, Mask, SamplingGrid, Units, choices};
use std::sync::Arc;

/// Report where the equations do not determine every unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RankPolicy {
    /// NaN, and status `Unobservable`.
    #[default]
    Nan,
    /// The solution of least norm, and status `MinNorm`.
    MinNorm,
}

choices!(RankPolicy, "rank_deficient": Nan "nan", MinNorm "min_norm");

/// A flow from elsewhere that an estimate starts from, px/frame; NaN where it is unknown.
#[derive(Debug, Clone, PartialEq)]
pub struct InitialFlow {
    /// Along x, of the frames' size.
    pub u: Frame<f32>,
    /// Along y.
    pub v: Frame<f32>,
}

impl InitialFlow {
    /// From row-major planes of a frame of `size = (width, height)`; NaN where it is unknown.
    ///
    /// # Errors
    /// [`Error::Argument`] for planes of another size, and naming `initial` for an infinite value.
    pub fn new((width, height): (usize, usize), u: &[f32], v: &[f32]) -> Result<Self> {
        if let Some(value) = u.iter().chain(v).find(|value| value.is_infinite()) {
            return Err(Error::argument("initial", "a finite flow, px/frame, or NaN where it is unknown", value));
        }
        let frame = |plane: &[f32]| Frame::new(width, height, plane.to_vec());
        Ok(Self { u: frame(u)?, v: frame(v)? })
    }
}

/// Options that all methods share.
#[derive(Debug, Clone, Default)]
pub struct EstimatorOptions {
    /// Pixels to estimate at. Default: all. Nothing else is computed.
    pub sites: SamplingGrid,
    /// Pixels that may be used (`true`), of the frames' size. Default: all.
    pub mask: Option<Mask>,
    /// Flow that competes with the one that the frames alone give, for methods that start from one
    /// ([`MethodInfo::takes_initial`](super::MethodInfo)). Default: none.
    pub initial: Option<Arc<InitialFlow>>,
    /// What the field's lengths and times are measured in. Default: px and frames.
    pub units: Units,
    /// Whether to compute the covariance of the parameters. Default: no.
    pub covariance: bool,
    /// Whether to report the systematic part of the covariance, if the method has one
    /// ([`FlowField::systematic`](crate::types::FlowField)). Default: no.
    pub systematic: bool,
    /// Whether to report residual, rank and condition number of each site. Default: no.
    pub diagnostics: bool,
    /// Standard deviation of the pixel noise, grey levels. `None` (default): from the frames.
    pub noise: Option<f64>,
    /// Threads. Default: `JACOFLOW_THREADS`, else every processor.
    pub threads: Threads,
    /// Instruction set. `None` (default): the best of the processor, or `JACOFLOW_SIMD`.
    pub simd: Option<Level>,
}

impl EstimatorOptions {
    /// Checks lengths, times and noise levels, and the environment if it decides.
    pub(super) fn check(&self) -> Result<()> {
        self.units.check()?;
        if let Some(noise) = self.noise.filter(|n| !(n.is_finite() && *n >= 0.0)) {
            return Err(Error::argument("noise", "a standard deviation of 0 grey levels or more", noise));
        }
        if let SamplingGrid::Grid { stride: 0, .. } = self.sites {
            return Err(Error::argument("stride", "a positive integer", 0));
        }
        self.threads.check()?;
        Level::check(self.simd)?;
        Ok(())
    }

    /// The instruction set to use.
    pub fn level(&self) -> Level {
        self.simd.unwrap_or_else(Level::detect)
    }
}
