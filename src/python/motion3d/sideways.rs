//! Translations along the image plane, for Python.

use super::given::{rows, word};
use crate::error::Error;
use crate::motion3d::{SidewaysBound, SidewaysEstimate, SidewaysWeights, estimate_sideways, sideways_bound};
use crate::python::arrays;
use numpy::PyArrayDyn;
use pyo3::prelude::*;

/// Weights by the words of the Python function.
const WEIGHTS: [(&str, SidewaysWeights); 3] =
    [("shrunk", SidewaysWeights::Shrunk), ("ml", SidewaysWeights::Likelihood), ("ones", SidewaysWeights::Ones)];

/// An estimate.
#[derive(IntoPyObject)]
pub struct ToldSideways<'py> {
    angle: f64,
    variance: f64,
    crlb: f64,
    sigma: f64,
    inv_depth: Bound<'py, PyArrayDyn<f64>>,
}

/// A bound.
#[derive(IntoPyObject)]
pub struct ToldSidewaysBound {
    crlb: f64,
    ml_variance: f64,
    ones_variance: f64,
    shrunk_variance: f64,
    crossover: f64,
}

#[pyfunction]
#[pyo3(name = "_motion3d_sideways")]
pub fn motion3d_sideways<'py>(
    py: Python<'py>,
    flow: &Bound<'py, PyAny>,
    sigma: Option<f64>,
    weights: &str,
) -> PyResult<ToldSideways<'py>> {
    let weights = word("weights", weights, &WEIGHTS)?;
    let (shape, values) = arrays::doubles("flow", flow)?;
    let flow: Vec<[f64; 2]> = rows("flow", &shape, &values)?;
    let SidewaysEstimate { angle, variance, bound, sigma, inverse_depth } =
        py.detach(|| estimate_sideways(&flow, sigma, weights))?;
    let inv_depth = arrays::owned(py, &[inverse_depth.len()], inverse_depth)?;
    Ok(ToldSideways { angle, variance, crlb: bound, sigma, inv_depth })
}

#[pyfunction]
#[pyo3(name = "_motion3d_sideways_bound")]
pub fn motion3d_sideways_bound(
    py: Python<'_>,
    inverse_depth: &Bound<'_, PyAny>,
    sigma: f64,
) -> PyResult<ToldSidewaysBound> {
    let (shape, depths) = arrays::doubles("inv_depth", inverse_depth)?;
    if shape.len() != 1 {
        return Err(Error::argument("inv_depth", "shape (N,)", format!("shape {shape:?}")).into());
    }
    let SidewaysBound { bound, likelihood, ones, shrunk, crossover } = py.detach(|| sideways_bound(&depths, sigma))?;
    Ok(ToldSidewaysBound {
        crlb: bound,
        ml_variance: likelihood,
        ones_variance: ones,
        shrunk_variance: shrunk,
        crossover,
    })
}
