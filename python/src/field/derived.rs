//! Parameters and derived quantities by name.

use crate::errors::Outcome;
use crate::image::renamed;
use jacoflow::error::{Error, Result};
use jacoflow::flow::derived::{Aggregate, Measured, Quantity, parameter_mean, plane, planes, region_mean};
use jacoflow::math::Real;
use jacoflow::types::{FieldLayout, FlowField, MOTION_NAMES, Region, Units};
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict};

/// Values of a parameter or quantity at every site.
pub fn value<T: Real>(field: &FlowField<T>, name: &str) -> Result<Vec<f64>> {
    match field.plane(name) {
        Some(plane) => Ok(plane.iter().map(|v| v.to_f64()).collect()),
        None => plane(field, quantity(&field.layout, name)?).map_err(by_name),
    }
}

/// Standard deviations of a parameter or quantity at every site.
pub fn std<T: Real>(field: &FlowField<T>, name: &str) -> Result<Vec<f64>> {
    if field.covariance.is_none() {
        return Err(Error::argument("std", "a field with covariance (option covariance=True)", "one without"));
    }
    match field.standard_deviation(name) {
        Some(plane) => Ok(plane.iter().map(|v| v.to_f64()).collect()),
        None => Ok(planes(field, quantity(&field.layout, name)?).map_err(by_name)?.1.unwrap_or_default()),
    }
}

/// Value, standard deviation and number of sites of a parameter or quantity in a region.
pub fn region<T: Real>(
    field: &FlowField<T>,
    name: &str,
    region: Option<&Region>,
    aggregate: Option<&str>,
) -> Result<(f64, f64, usize)> {
    let aggregate = match aggregate {
        None => Aggregate::default(),
        Some("inverse_variance") => Aggregate::InverseVariance,
        Some("median") => Aggregate::Median,
        Some(other) => {
            let expected = "\"inverse_variance\" or \"median\"";
            return Err(Error::argument("aggregate", expected, format!("{other:?}")));
        }
    };
    let mean = if field.plane(name).is_some() {
        parameter_mean(field, name, region, aggregate)?
    } else {
        region_mean(field, quantity(&field.layout, name)?, region, aggregate).map_err(by_name)?
    };
    Ok((mean.value, mean.std, mean.count))
}

/// The same error with the argument called as Python calls it.
pub fn by_name(error: Error) -> Error {
    renamed(error, "quantity", "name")
}

/// The parameter of affine motion or the derived quantity called `name`.
pub fn measured(layout: &FieldLayout, name: &str) -> Result<Measured> {
    match MOTION_NAMES.iter().position(|known| *known == name) {
        Some(place) => Ok(Measured::Parameter(place)),
        None if layout.parameters.iter().any(|known| known == name) => {
            let expected = "a parameter of affine motion or a derived quantity; region_mean takes the others";
            Err(Error::argument("name", expected, format!("{name:?}")))
        }
        None => quantity(layout, name).map(Measured::Derived),
    }
}

/// Unit of a parameter or quantity.
pub fn unit(layout: &FieldLayout, name: &str) -> Result<String> {
    if layout.parameters.iter().any(|known| known == name) {
        return Ok(layout.units.of_parameter(name));
    }
    Ok(quantity(layout, name)?.unit(&layout.units))
}

fn quantity(layout: &FieldLayout, name: &str) -> Result<Quantity> {
    Quantity::parse(name).map_err(|_| {
        let parameters: Vec<&str> = layout.parameters.iter().map(String::as_str).collect();
        Error::argument("name", Quantity::expected(name, &parameters), format!("{name:?}"))
    })
}

/// Derived quantities with their units (per frame, with a frame period), as a dictionary.
#[pyfunction]
pub fn quantities(py: Python<'_>) -> Outcome<Bound<'_, PyDict>> {
    let (frames, seconds) = (Units::default(), Units::new((1.0, 1.0), None, Some(1.0)));
    Ok(Quantity::ALL.iter().map(|q| (q.name(), (q.unit(&frames), q.unit(&seconds)))).into_py_dict(py)?)
}
