//! The per-pixel estimate, WO2010/098160 (34): `[J(i); J(i')] m = [i'; i'']`, least squares at each pixel on
//! its own.
//!
//! Two paths. The careful one ([`point`]) solves one pixel by orthogonal transformations in double precision
//! and can say everything about it: rank, condition, residual, covariance. The fast one (`dense`) runs the
//! affine model over rows in lanes by normal equations, with covariance, residual and condition where they
//! are wanted; pixels whose pivots are too small for its precision are done again in double precision, at
//! last by the careful path. What is reported as unobservable is always the careful path's decision.
//!
//! `job` runs bands of rows with their `buffers`. The fast path: `dense` with `normal` (equations, solved by
//! `blocks`); `detail` adds covariance and diagnostics (`uncertainty`, `propagation`, `lane_noise`,
//! `condition`). `noise` is the careful path's covariance; `output` puts estimates in their places.
//!
//! Equations are formed per px and frame for any pixel pitch, so that the pitch scales results and
//! never changes a decision.

mod blocks;
mod buffers;
mod condition;
mod dense;
mod detail;
mod job;
mod lane_noise;
mod noise;
mod normal;
mod output;
mod point;
mod propagation;
mod uncertainty;

use super::{model::ModelKind, options::EstimatorOptions, options::RankPolicy, site::bands};
use crate::error::Result;
use crate::jet::{JetRows, JetStencil, Neighbourhood, TimeScheme};
use crate::parallel;
use crate::simd::SimdReal;
use crate::types::{FlowField, Frame, Rect, SamplingGrid};
use dense::Source;
use job::{Job, RowPlan, SiteMask};
use lane_noise::LaneNoise;
use noise::NoiseModel;
pub(super) use point::rounding_floor;

/// Options of the per-pixel estimate.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct InstantaneousOptions {
    /// The motion model. Default: affine.
    pub model: ModelKind,
    /// Time differences. Default: central.
    pub scheme: TimeScheme,
    /// The pixels a jet is fitted to. Default: 3x3.
    pub neighbourhood: Neighbourhood,
    /// What to report where a pixel is not observable. Default: NaN.
    pub rank_deficient: RankPolicy,
}

/// The estimator behind the options.
#[derive(Debug)]
pub(super) struct Instantaneous {
    options: InstantaneousOptions,
    stencil: JetStencil,
    noise: NoiseModel,
    /// The same for the affine model in lanes.
    lane_noise: LaneNoise<f64>,
}

impl Instantaneous {
    /// Prepares the stencil.
    pub fn new(options: &InstantaneousOptions, common: &EstimatorOptions) -> Result<Self> {
        let stencil = JetStencil::new(&options.neighbourhood, (1.0, 1.0))?;
        let noise = NoiseModel::new(&stencil, options.scheme, common.noise);
        let lane_noise = noise.lanes();
        Ok(Self { options: options.clone(), stencil, noise, lane_noise })
    }

    /// The motion model.
    pub fn model(&self) -> ModelKind {
        self.options.model
    }

    /// Which of the three frames the estimate belongs to.
    pub fn frame(&self) -> usize {
        self.options.scheme.frame()
    }

    /// Fills `field`, in px and frames. `frames`: three of one size, oldest first.
    pub fn estimate_into<T: SimdReal>(
        &self,
        frames: [&Frame<T>; 3],
        common: &EstimatorOptions,
        field: &mut FlowField<T>,
    ) {
        let mask = common.mask.as_ref().map(SiteMask::new);
        let noise = (common.covariance || common.diagnostics).then(|| self.lane_noise.cast());
        let job = Job { owner: self, frames, common, mask, noise };
        let (width, sites) = (field.width, field.layout.sites.clone());
        let quick = self.options.model == ModelKind::Affine;
        let rows = match (&sites, quick) {
            (&SamplingGrid::Grid { region, stride }, true) => {
                let (w, h) = frames[0].size();
                let region = region.unwrap_or(Rect { x: 0, y: 0, width: w, height: h });
                Some(RowPlan { region, stride, source: self.source::<T>() })
            }
            _ => None,
        };
        let all = bands(field);
        common.threads.install(|| {
            parallel::for_each(all, |mut band| {
                if let Some(plan) = &rows {
                    return job.rows(&mut band, width, plan);
                }
                for index in band.sites.clone() {
                    let at = sites.pixel(index % width, index / width);
                    if quick {
                        job.site(&mut band, index, at);
                    } else {
                        job.careful(&mut band, index, at);
                    }
                }
            });
        });
    }

    /// The quickest way to the jets of rows.
    fn source<T: SimdReal>(&self) -> Source<T> {
        match self.options.neighbourhood {
            Neighbourhood::Rectangle { width: 3, height: 3, sigma: None } => Source::Three,
            _ => Source::Rows(JetRows::new(&self.stencil)),
        }
    }
}
