//! Points of a flow field for 3-D motion, and times to contact all over it.

use super::flow::{motion, spread};
use super::given::{camera, fixed, triple, word};
use super::options::{Options, PLACEMENTS};
use super::results::{PyEstimate, matrix};
use crate::errors::Outcome;
use crate::interrupt::interruptible;
use crate::options::{self, Integer, Region};
use crate::{arrays, field::FlowField, field::Store, field::each};
use jacoflow::error::Error;
use jacoflow::motion3d::{
    FieldOptions, RotationPrior, SystematicEffect, UncertainMotion, contact_map, estimate_field_motion, field_points,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// An array of doubles.
type Array<'py> = Bound<'py, PyAny>;

#[pyfunction]
#[pyo3(name = "_motion3d_field_points")]
pub fn motion3d_field_points<'py>(
    py: Python<'py>,
    field: &FlowField,
    spacing: Option<f64>,
    max_points: Option<usize>,
    region: Option<Region>,
) -> Outcome<(Array<'py>, Array<'py>, Array<'py>, [f64; 5])> {
    single(field)?;
    let chosen = FieldOptions { spacing, max_points, region: options::region(region)?, ..FieldOptions::default() };
    let found = each!(field.store(), packed => {
        let field = field.core(packed, 0);
        interruptible(py, || field_points(&field, &chosen))
    })?;
    let n = found.points.len();
    Ok((
        matrix(py, &found.points)?.into_any(),
        matrix(py, &found.flow)?.into_any(),
        arrays::owned(py, &[n, 2, 2], found.covariances)?,
        [
            found.spacing,
            found.points_per_independent_sample,
            found.correlation_length,
            found.systematic_errors.scale,
            found.systematic_errors.offset,
        ],
    ))
}

/// Which points of a field are taken, by the keywords of the Python function.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct FieldLayout<'py> {
    spacing: Option<f64>,
    max_points: Option<Integer>,
    region: Option<Region>,
    patches: Option<Integer>,
    /// Status, rotation and covariance of the scene around the region.
    scene: Option<(String, Array<'py>, Array<'py>)>,
    object_rotation_std: f64,
}

impl FieldLayout<'_> {
    /// As the core takes it.
    fn core(&self) -> Outcome<FieldOptions> {
        let region = options::region(self.region)?;
        let max_points = self.max_points.map(|limit| options::count("max_points", limit)).transpose()?;
        let patches = self.patches.map(|side| options::count("patches", side)).transpose()?;
        Ok(FieldOptions { spacing: self.spacing, region, excluded: None, max_points, patches })
    }

    /// The scene's rotation as what is known of the object's, if a scene is given.
    fn rotation_prior(&self, given: Option<RotationPrior>) -> Outcome<Option<RotationPrior>> {
        let std = self.object_rotation_std;
        if !(std.is_finite() && std > 0.0) {
            return Err(Error::argument("object_rotation_std", "a positive number", std).into());
        }
        let Some((status, rotation, covariance)) = &self.scene else { return Ok(given) };
        let wrong = |name: &'static str, expected: &str, got: String| Err(Error::argument(name, expected, got).into());
        if self.patches.is_some() {
            return wrong("scene", "its default with patches", "a motion".into());
        }
        if self.region.is_none() {
            return wrong("scene", "a region, of the object whose motion is estimated", "no region".into());
        }
        if given.is_some() {
            return wrong("rotation_prior", "none with a scene, whose rotation it would be", "both".into());
        }
        let prior = RotationPrior::of_scene(triple("scene", rotation)?, &fixed("scene", covariance)?, std);
        prior.map_or_else(
            || wrong("scene", "a motion whose rotation is known", format!("status {status}")),
            |known| Ok(Some(known)),
        )
    }
}

#[pyfunction]
#[pyo3(name = "_motion3d_estimate_field")]
pub fn motion3d_estimate_field<'py>(
    py: Python<'py>,
    field: &FlowField,
    intrinsics: Option<&Array<'py>>,
    layout: FieldLayout<'py>,
    options: Options<'py>,
) -> Outcome<(PyEstimate<'py>, Array<'py>)> {
    single(field)?;
    let wrong = || Error::argument("K", "a camera matrix (3, 3), px, as a field's points are pixels", "None");
    let camera = camera(intrinsics)?.ok_or_else(wrong)?;
    let (chosen, mut options) = (layout.core()?, options.core()?);
    options.rotation_prior = layout.rotation_prior(options.rotation_prior)?;
    let found = each!(field.store(), packed => {
        let field = field.core(packed, 0);
        interruptible(py, || estimate_field_motion(&field, &camera, &chosen, &options))
    })?;
    Ok((PyEstimate::new(py, found.estimate)?, matrix(py, &found.points)?.into_any()))
}

fn single(field: &FlowField) -> Outcome<()> {
    let message = "field: expected a single field, got a stack; take field[t]";
    if field.count().1 { Err(PyValueError::new_err(message).into()) } else { Ok(()) }
}

/// A motion with its covariance, as in its result.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct PyUncertainMotion<'py> {
    translation: Array<'py>,
    rotation: Array<'py>,
    tangent: Array<'py>,
    covariance: Array<'py>,
    scale: f64,
    displacements: Array<'py>,
    moves: Array<'py>,
}

impl PyUncertainMotion<'_> {
    /// As the core takes it.
    fn core(&self) -> Outcome<UncertainMotion> {
        let (tangent, covariance) = spread(&self.tangent, &self.covariance)?;
        let displaced = fixed("systematic_errors.displacements", &self.displacements)?;
        let systematic_errors =
            SystematicEffect { scale: self.scale, displaced, motion: fixed("systematic_errors.motion", &self.moves)? };
        Ok(UncertainMotion {
            motion: motion(&self.translation, &self.rotation)?,
            tangent,
            covariance,
            systematic_errors,
        })
    }
}

#[pyfunction]
#[pyo3(name = "_motion3d_contact_map")]
pub fn motion3d_contact_map<'py>(
    py: Python<'py>,
    field: &FlowField,
    intrinsics: Option<&Array<'py>>,
    known: PyUncertainMotion<'py>,
    placement: &str,
) -> Outcome<(Array<'py>, Array<'py>, Array<'py>)> {
    single(field)?;
    let wrong = || Error::argument("K", "a camera matrix (3, 3), px", "None");
    let camera = camera(intrinsics)?.ok_or_else(wrong)?;
    let known = known.core()?;
    let placement = word("placement", placement, &PLACEMENTS)?;
    let found = each!(field.store(), packed => {
        let field = field.core(packed, 0);
        interruptible(py, || contact_map(&field, &camera, &known, placement))
    })?;
    let shape = [found.height, found.width];
    Ok((
        arrays::owned(py, &shape, found.contact)?,
        arrays::owned(py, &shape, found.deviation)?,
        arrays::owned(py, &shape, found.residual)?,
    ))
}
