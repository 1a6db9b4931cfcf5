//! Points of a flow field for 3-D motion, and times to contact all over it.

use super::flow::{motion, spread};
use super::given::{fixed, square, word};
use super::options::PLACEMENTS;
use super::results::matrix;
use crate::motion3d::{
    CommonEffect, FieldOptions, Intrinsics, UncertainMotion, contact_map, field_patches, field_points,
};
use crate::python::arrays;
use crate::python::field::{FlowField, Store, each};
use crate::python::options::{self, Region};
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
    most: Option<usize>,
    region: Option<Region>,
) -> PyResult<(Array<'py>, Array<'py>, Array<'py>, [f64; 5])> {
    single(field)?;
    let chosen = FieldOptions { spacing, most, region: options::region(region)? };
    let found = each!(field.store(), packed => {
        let field = field.core(packed, 0);
        py.detach(|| field_points(&field, &chosen))
    })?;
    let n = found.points.len();
    Ok((
        matrix(py, &found.points)?.into_any(),
        matrix(py, &found.flow)?.into_any(),
        arrays::owned(py, &[n, 2, 2], found.covariances)?.into_any(),
        [
            found.spacing,
            found.points_per_independent_sample,
            found.correlation_length,
            found.common.scale,
            found.common.offset,
        ],
    ))
}

#[pyfunction]
#[pyo3(name = "_motion3d_field_patches")]
pub fn motion3d_field_patches<'py>(
    py: Python<'py>,
    field: &FlowField,
    size: usize,
    region: Option<Region>,
) -> PyResult<(Array<'py>, Array<'py>, Array<'py>, [f64; 2])> {
    single(field)?;
    let region = options::region(region)?;
    let found = each!(field.store(), packed => {
        let field = field.core(packed, 0);
        py.detach(|| field_patches(&field, size, region))
    })?;
    let n = found.points.len();
    Ok((
        matrix(py, &found.points)?.into_any(),
        matrix(py, &found.motion)?.into_any(),
        arrays::owned(py, &[n, 6, 6], found.covariances)?.into_any(),
        [found.common.scale, found.common.offset],
    ))
}

fn single(field: &FlowField) -> PyResult<()> {
    let message = "field: expected a single field, got a stack; take field[t]";
    if field.count().1 { Err(PyValueError::new_err(message)) } else { Ok(()) }
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
    fn core(&self) -> PyResult<UncertainMotion> {
        let (tangent, covariance) = spread(&self.tangent, &self.covariance)?;
        let displaced = fixed("common_errors.displacements", &self.displacements)?;
        let common = CommonEffect { scale: self.scale, displaced, motion: fixed("common_errors.motion", &self.moves)? };
        Ok(UncertainMotion { motion: motion(&self.translation, &self.rotation)?, tangent, covariance, common })
    }
}

#[pyfunction]
#[pyo3(name = "_motion3d_contact_map")]
pub fn motion3d_contact_map<'py>(
    py: Python<'py>,
    field: &FlowField,
    intrinsics: &Array<'py>,
    known: PyUncertainMotion<'py>,
    placement: &str,
) -> PyResult<(Array<'py>, Array<'py>, Array<'py>)> {
    single(field)?;
    let camera = Intrinsics::new(square("K", "", intrinsics)?)?;
    let known = known.core()?;
    let placement = word("placement", placement, &PLACEMENTS)?;
    let found = each!(field.store(), packed => {
        let field = field.core(packed, 0);
        py.detach(|| contact_map(&field, &camera, &known, placement))
    })?;
    let shape = [found.height, found.width];
    Ok((
        arrays::owned(py, &shape, found.contact)?.into_any(),
        arrays::owned(py, &shape, found.deviation)?.into_any(),
        arrays::owned(py, &shape, found.residual)?.into_any(),
    ))
}
