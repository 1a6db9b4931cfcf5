//! The core's options from the keywords of the Python function.

use super::{given::square, given::triple, given::word};
use crate::errors::Outcome;
use crate::{arrays, options::Integer, options::threads};
use jacoflow::error::Error;
use jacoflow::motion3d::{Method, Motion, MotionOptions, Placement, RotationPrior, Smoother};
use pyo3::prelude::*;

/// Where a displacement is taken to be the instantaneous flow, by name.
pub const PLACEMENTS: [(&str, Placement); 2] = [("midpoint", Placement::Midpoint), ("start", Placement::Start)];

/// How the motion is looked for.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Options<'py> {
    method: String,
    robust: bool,
    placement: String,
    smoother: String,
    weight_inv_depth: Option<Bound<'py, PyAny>>,
    rotation_prior: Option<(Bound<'py, PyAny>, Bound<'py, PyAny>)>,
    initial: Option<(Bound<'py, PyAny>, Bound<'py, PyAny>)>,
    points_per_independent_sample: Option<f64>,
    correlation_length: Option<f64>,
    flow_scale_std: Option<f64>,
    flow_bias_std: Option<f64>,
    random_state: Integer,
    threads: Option<Integer>,
}

impl Options<'_> {
    /// As the core takes them.
    pub fn core(&self) -> Outcome<MotionOptions> {
        let methods = [("auto", Method::Auto), ("ml", Method::MaximumLikelihood), ("efficient", Method::Efficient)];
        let smoothers = [("auto", Smoother::Auto), ("prior", Smoother::Prior), ("neighbours", Smoother::Neighbours)];
        let weights = self.weight_inv_depth.as_ref().map(|given| arrays::doubles("weight_inv_depth", given));
        let wrong_random_state = |_| Error::argument("random_state", "an integer of at least 0", self.random_state);
        Ok(MotionOptions {
            method: word("method", &self.method, &methods)?,
            robust: self.robust,
            placement: word("placement", &self.placement, &PLACEMENTS)?,
            smoother: word("smoother", &self.smoother, &smoothers)?,
            weight_depths: weights.transpose()?.map(|(_, values)| values),
            initial: self.initial()?,
            rotation_prior: self.rotation_prior()?,
            points_per_independent_sample: self.points_per_independent_sample,
            correlation_length: self.correlation_length,
            flow_scale_std: self.flow_scale_std,
            flow_bias_std: self.flow_bias_std,
            random_state: u64::try_from(self.random_state.0).map_err(wrong_random_state)?,
            threads: threads(self.threads)?,
        })
    }

    fn initial(&self) -> Outcome<Option<Motion>> {
        let Some((translation, rotation)) = &self.initial else { return Ok(None) };
        Ok(Some(Motion { translation: triple("initial", translation)?, rotation: triple("initial", rotation)? }))
    }

    fn rotation_prior(&self) -> Outcome<Option<RotationPrior>> {
        let Some((rotation, covariance)) = &self.rotation_prior else { return Ok(None) };
        let rotation = triple("rotation_prior", rotation)?;
        Ok(Some(RotationPrior { rotation, covariance: square("rotation_prior", "a covariance of ", covariance)? }))
    }
}
