//! Points of a flow field for 3-D motion.

use crate::motion3d::{FieldOptions, field_points};
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
) -> PyResult<(Array<'py>, Array<'py>, Array<'py>, f64, f64)> {
    if field.count().1 {
        return Err(PyValueError::new_err("field: expected a single field, got a stack; take field[t]"));
    }
    let chosen = FieldOptions { spacing, most, region: options::region(region)? };
    let found = each!(field.store(), packed => {
        let field = field.core(packed, 0);
        py.detach(|| field_points(&field, &chosen))
    })?;
    let n = found.points.len();
    let flat = |rows: Vec<[f64; 2]>| rows.into_iter().flatten().collect::<Vec<f64>>();
    Ok((
        arrays::owned(py, &[n, 2], flat(found.points))?.into_any(),
        arrays::owned(py, &[n, 2], flat(found.flow))?.into_any(),
        arrays::owned(py, &[n, 2, 2], found.covariances)?.into_any(),
        found.spacing,
        found.shared,
    ))
}
