//! Results as Python takes them: dictionaries with the names of the dataclasses' fields.

use crate::arrays;
use crate::errors::Outcome;
use jacoflow::motion3d::{Motion, MotionBound, MotionEstimate, SystematicEffect};
use pyo3::prelude::*;

type Array<'py> = Bound<'py, PyAny>;

/// The rows one after the other.
pub fn flat<const D: usize>(rows: &[[f64; D]]) -> Vec<f64> {
    rows.as_flattened().to_vec()
}

/// A vector of space.
pub fn vector(py: Python<'_>, values: [f64; 3]) -> Outcome<Array<'_>> {
    arrays::owned(py, &[3], values.to_vec())
}

/// Rows as a matrix.
pub fn matrix<'py, const D: usize>(py: Python<'py>, rows: &[[f64; D]]) -> Outcome<Array<'py>> {
    arrays::owned(py, &[rows.len(), D], flat(rows))
}

fn values(py: Python<'_>, each: Vec<f64>) -> Outcome<Array<'_>> {
    arrays::owned(py, &[each.len()], each)
}

/// A motion with its covariance, or one of the other motions, which have none.
#[derive(IntoPyObject)]
struct PyMotion<'py> {
    translation: Array<'py>,
    rotation: Array<'py>,
    cost: f64,
    covariance: Option<Array<'py>>,
    tangent: Option<Array<'py>>,
}

impl<'py> PyMotion<'py> {
    fn new(py: Python<'py>, motion: &Motion, cost: f64) -> Outcome<Self> {
        let (translation, rotation) = (vector(py, motion.translation)?, vector(py, motion.rotation)?);
        Ok(Self { translation, rotation, cost, covariance: None, tangent: None })
    }
}

/// What errors do that all flow has in common.
#[derive(IntoPyObject)]
struct PySystematicEffect<'py> {
    scale: f64,
    displacements: Array<'py>,
    motion: Array<'py>,
}

impl<'py> PySystematicEffect<'py> {
    fn new(py: Python<'py>, effect: &SystematicEffect) -> Outcome<Self> {
        let (displacements, motion) = (matrix(py, &effect.displaced)?, matrix(py, &effect.motion)?);
        Ok(Self { scale: effect.scale, displacements, motion })
    }
}

/// An estimate.
#[derive(IntoPyObject)]
pub struct PyEstimate<'py> {
    translation: Array<'py>,
    rotation: Array<'py>,
    status: &'static str,
    method_used: &'static str,
    fell_back: bool,
    covariance: Array<'py>,
    tangent: Array<'py>,
    systematic_errors: PySystematicEffect<'py>,
    crlb: Array<'py>,
    direction_std: f64,
    rotation_std: Array<'py>,
    inv_depth: Array<'py>,
    inv_depth_std: Array<'py>,
    inv_depth_smooth: Array<'py>,
    /// `(nu, nu_x, nu_y)` a patch; none of points.
    surfaces: Array<'py>,
    time_to_contact: Array<'py>,
    time_to_contact_std: Array<'py>,
    approach_rate: f64,
    approach_rate_std: f64,
    inliers: Array<'py>,
    noise_std: f64,
    residuals: Array<'py>,
    alternatives: Vec<PyMotion<'py>>,
    ml: PyMotion<'py>,
}

impl<'py> PyEstimate<'py> {
    pub fn new(py: Python<'py>, found: MotionEstimate) -> Outcome<Self> {
        let likelihood = &found.likelihood;
        let ml = PyMotion {
            covariance: Some(matrix(py, &likelihood.covariance)?),
            tangent: Some(matrix(py, &likelihood.tangent)?),
            ..PyMotion::new(py, &likelihood.motion, likelihood.cost)?
        };
        let others = found.alternatives.iter().map(|other| PyMotion::new(py, &other.motion, other.excess));
        Ok(Self {
            translation: vector(py, found.motion.translation)?,
            rotation: vector(py, found.motion.rotation)?,
            status: found.status.name(),
            method_used: if found.efficient { "efficient" } else { "ml" },
            fell_back: found.fell_back,
            covariance: matrix(py, &found.covariance)?,
            tangent: matrix(py, &found.tangent)?,
            systematic_errors: PySystematicEffect::new(py, &found.systematic_errors)?,
            crlb: matrix(py, &found.bound)?,
            direction_std: found.direction_std,
            rotation_std: vector(py, found.rotation_std)?,
            surfaces: matrix(py, &found.surfaces)?,
            approach_rate: found.approach.0,
            approach_rate_std: found.approach.1,
            noise_std: found.noise_std,
            alternatives: others.collect::<Outcome<_>>()?,
            ml,
            inv_depth: values(py, found.inverse_depth)?,
            inv_depth_std: values(py, found.inverse_depth_std)?,
            inv_depth_smooth: values(py, found.inverse_depth_smooth)?,
            time_to_contact: values(py, found.time_to_contact)?,
            time_to_contact_std: values(py, found.time_to_contact_std)?,
            residuals: values(py, found.residuals)?,
            inliers: arrays::owned(py, &[found.inliers.len()], found.inliers)?,
        })
    }
}

/// A bound.
#[derive(IntoPyObject)]
pub struct PyBound<'py> {
    crlb: Array<'py>,
    ml_covariance: Array<'py>,
    ideal_covariance: Array<'py>,
    tangent: Array<'py>,
    direction_std: Array<'py>,
}

impl<'py> PyBound<'py> {
    pub fn new(py: Python<'py>, bound: &MotionBound) -> Outcome<Self> {
        Ok(Self {
            crlb: matrix(py, &bound.bound)?,
            ml_covariance: matrix(py, &bound.likelihood)?,
            ideal_covariance: matrix(py, &bound.ideal)?,
            tangent: matrix(py, &bound.tangent)?,
            direction_std: vector(py, bound.direction_std)?,
        })
    }
}
