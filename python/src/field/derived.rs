//! Parameters and derived quantities by name.

use crate::errors::Outcome;
use jacoflow::error::{Error, Result};
use jacoflow::flow::derived::{Aggregate, Quantity, parameter_mean, plane, planes, region_mean};
use jacoflow::flow::model::ModelKind;
use jacoflow::math::Real;
use jacoflow::types::{FieldLayout, FlowField, Rect};
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict};

/// Values of a parameter or quantity at every site.
pub fn value<T: Real>(field: &FlowField<T>, name: &str) -> Result<Vec<f64>> {
    match field.plane(name) {
        Some(plane) => Ok(plane.iter().map(|v| v.to_f64()).collect()),
        None => plane(field, quantity(&field.layout, name)?),
    }
}

/// Standard deviations of a parameter or quantity at every site.
pub fn std<T: Real>(field: &FlowField<T>, name: &str) -> Result<Vec<f64>> {
    if field.covariance.is_none() {
        return Err(Error::argument("std", "a field with covariance (option covariance=True)", "one without"));
    }
    match field.standard_deviation(name) {
        Some(plane) => Ok(plane.iter().map(|v| v.to_f64()).collect()),
        None => Ok(planes(field, quantity(&field.layout, name)?)?.1.unwrap_or_default()),
    }
}

/// Value, standard deviation and number of sites of a parameter or quantity in a region.
pub fn region<T: Real>(
    field: &FlowField<T>,
    name: &str,
    region: Option<Rect>,
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
        region_mean(field, quantity(&field.layout, name)?, region, aggregate)?
    };
    Ok((mean.value, mean.std, mean.count))
}

/// Unit of a parameter or quantity.
pub fn unit(layout: &FieldLayout, name: &str) -> Result<&'static str> {
    let parameters = ModelKind::parse(&layout.model).unwrap_or_default().parameters();
    match parameters.iter().find(|p| p.name == name && layout.parameters.iter().any(|known| known == name)) {
        Some(parameter) => Ok(parameter.unit()),
        None => Ok(quantity(layout, name)?.unit(layout.frame_period.is_some())),
    }
}

fn quantity(layout: &FieldLayout, name: &str) -> Result<Quantity> {
    Quantity::parse(name).map_err(|_| {
        let quantities = Quantity::ALL.iter().map(|q| q.name());
        let names: Vec<&str> = layout.parameters.iter().map(String::as_str).chain(quantities).collect();
        Error::argument("name", format!("one of {}", names.join(", ")), format!("{name:?}"))
    })
}

/// Derived quantities with their units (per frame, with a frame period), as a dictionary.
#[pyfunction]
pub fn quantities(py: Python<'_>) -> Outcome<Bound<'_, PyDict>> {
    Ok(Quantity::ALL.iter().map(|q| (q.name(), (q.unit(false), q.unit(true)))).into_py_dict(py)?)
}
