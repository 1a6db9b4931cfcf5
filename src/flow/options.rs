//! What every estimator of this room is told.

use super::baseline::{HornSchunckOptions, LucasKanadeOptions, Window};
use super::coarse_to_fine::{CoarseToFineOptions, correlation_length};
use super::instantaneous::InstantaneousOptions;
use super::windowed::WindowedOptions;
use crate::error::{Error, Result};
use crate::parallel::Threads;
use crate::simd::Level;
use crate::types::{Mask, SamplingGrid};

/// What to report where the equations do not determine every unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RankPolicy {
    /// NaN, and status `Unobservable`.
    #[default]
    Nan,
    /// The solution of least norm, and status `MinNorm`.
    MinNorm,
}

impl RankPolicy {
    /// The policy called `name`: `nan` or `min_norm`.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `rank_deficient` for another word.
    pub fn parse(name: &str) -> Result<Self> {
        match name {
            "nan" => Ok(Self::Nan),
            "min_norm" => Ok(Self::MinNorm),
            other => Err(Error::argument("rank_deficient", "nan or min_norm", other)),
        }
    }

    /// The policy's name, as [`RankPolicy::parse`] takes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nan => "nan",
            Self::MinNorm => "min_norm",
        }
    }
}

/// Options that all methods share.
#[derive(Debug, Clone)]
pub struct EstimatorOptions {
    /// Where estimates are wanted. Default: every pixel. Nothing else is computed.
    pub sites: SamplingGrid,
    /// Pixels that may be used (`true`), of the frames' size. Default: all.
    pub mask: Option<Mask>,
    /// Physical size `(dx, dy)` of a pixel; flow comes in these units per frame. Default: 1 px.
    pub pixel_pitch: (f64, f64),
    /// Seconds between frames, kept with the result for quantities per second. Default: unknown.
    pub frame_period: Option<f64>,
    /// Whether to compute the covariance of the parameters. Default: no.
    pub covariance: bool,
    /// Whether to tell the systematic part of the covariance apart, where the method can
    /// ([`FlowField::systematic`](crate::types::FlowField)). Default: no.
    pub systematic: bool,
    /// Whether to report residual, rank and condition number of each site. Default: no.
    pub diagnostics: bool,
    /// Standard deviation of the pixel noise, grey levels, for the covariance. `None` (default): from the
    /// frames.
    pub noise: Option<f64>,
    /// Threads. Default: `JACOFLOW_THREADS`, else every processor.
    pub threads: Threads,
    /// Instruction set. `None` (default): the best of the processor, or `JACOFLOW_SIMD`.
    pub simd: Option<Level>,
}

impl Default for EstimatorOptions {
    fn default() -> Self {
        Self {
            sites: SamplingGrid::default(),
            mask: None,
            pixel_pitch: (1.0, 1.0),
            frame_period: None,
            covariance: false,
            systematic: false,
            diagnostics: false,
            noise: None,
            threads: Threads::default(),
            simd: None,
        }
    }
}

impl EstimatorOptions {
    /// Refuses lengths, times and noise levels that are not positive and finite, naming the field, and a
    /// useless environment where that decides.
    pub(super) fn check(&self) -> Result<()> {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        let (dx, dy) = self.pixel_pitch;
        if !(positive(dx) && positive(dy)) {
            return Err(Error::argument("pixel_pitch", "two positive, finite lengths", format!("({dx}, {dy})")));
        }
        if let Some(period) = self.frame_period.filter(|p| !positive(*p)) {
            return Err(Error::argument("frame_period", "a positive number of seconds", period));
        }
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

/// The ways to estimate flow from two or three frames.
#[derive(Debug, Clone)]
pub enum Method {
    /// Affine flow from coarse to fine: large motions, edges, untextured areas; the method for everyday
    /// frames.
    CoarseToFine(CoarseToFineOptions),
    /// Per pixel, (34): flow and Jacobian from a 3x3x3 block of brightness.
    Instantaneous(InstantaneousOptions),
    /// The same equations summed over a window in which the motion is affine.
    Windowed(WindowedOptions),
    /// Baseline: flow constant in a window.
    LucasKanade(LucasKanadeOptions),
    /// Baseline: globally smooth flow.
    HornSchunck(HornSchunckOptions),
}

impl Method {
    /// The method called `name` (`coarse_to_fine`, `windowed`, `instantaneous`, `lucas_kanade`,
    /// `horn_schunck`) with its default options.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `method` for another word.
    pub fn parse(name: &str) -> Result<Self> {
        match name {
            "coarse_to_fine" => Ok(Self::CoarseToFine(CoarseToFineOptions::default())),
            "instantaneous" => Ok(Self::Instantaneous(InstantaneousOptions::default())),
            "windowed" => Ok(Self::Windowed(WindowedOptions::default())),
            "lucas_kanade" => Ok(Self::LucasKanade(LucasKanadeOptions::default())),
            "horn_schunck" => Ok(Self::HornSchunck(HornSchunckOptions::default())),
            other => Err(Error::argument(
                "method",
                "coarse_to_fine, windowed, instantaneous, lucas_kanade or horn_schunck",
                other,
            )),
        }
    }

    /// The method's name, as [`Method::parse`] takes it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::CoarseToFine(_) => "coarse_to_fine",
            Self::Instantaneous(_) => "instantaneous",
            Self::Windowed(_) => "windowed",
            Self::LucasKanade(_) => "lucas_kanade",
            Self::HornSchunck(_) => "horn_schunck",
        }
    }

    /// How far errors of neighbouring estimates go together, px (see
    /// [`FieldLayout::correlation_length`](crate::types::FieldLayout)): the standard deviation of everything
    /// that an estimate is a weighted sum over.
    pub fn correlation_length(&self) -> f64 {
        match self {
            Self::CoarseToFine(options) => correlation_length(options.frames),
            Self::Instantaneous(o) => o.neighbourhood.spread(),
            Self::Windowed(o) => {
                let smoothing = o.presmooth.or(o.already_smoothed).unwrap_or(0.0);
                o.sigma.hypot(o.neighbourhood.spread()).hypot(smoothing)
            }
            Self::LucasKanade(o) => match o.window {
                Window::Gaussian(sigma) => sigma,
                Window::Box(side) => ((side * side - 1) as f64 / 12.0).sqrt(),
            },
            Self::HornSchunck(_) => 0.0,
        }
    }
}
