//! Translations along the image plane, for Python.

use super::{given::rows, given::word};
use crate::arrays;
use crate::errors::Outcome;
use jacoflow::error::{Error, shape_text};
use jacoflow::motion3d::{LateralBound, LateralEstimate, LateralWeights, estimate_lateral, lateral_bound};
use pyo3::prelude::*;

/// Weights by the words of the Python function.
const WEIGHTS: [(&str, LateralWeights); 3] =
    [("shrunk", LateralWeights::Shrunk), ("ml", LateralWeights::Likelihood), ("ones", LateralWeights::Ones)];

/// An estimate.
#[derive(IntoPyObject)]
pub struct PyLateral<'py> {
    angle: f64,
    variance: f64,
    crlb: f64,
    noise_std: f64,
    inv_depth: Bound<'py, PyAny>,
}

/// A bound.
#[derive(IntoPyObject)]
pub struct PyLateralBound {
    crlb: f64,
    ml_variance: f64,
    ones_variance: f64,
    shrunk_variance: f64,
    crossover: f64,
}

#[pyfunction]
#[pyo3(name = "_motion3d_lateral")]
pub fn motion3d_lateral<'py>(
    py: Python<'py>,
    flow: &Bound<'py, PyAny>,
    noise_std: Option<f64>,
    weights: &str,
) -> Outcome<PyLateral<'py>> {
    let weights = word("weights", weights, &WEIGHTS)?;
    let (shape, values) = arrays::doubles("flow", flow)?;
    let flow: Vec<[f64; 2]> = rows("flow", &shape, &values)?;
    let LateralEstimate { angle, variance, bound, noise_std, inverse_depth } =
        py.detach(|| estimate_lateral(&flow, noise_std, weights))?;
    let inv_depth = arrays::owned(py, &[inverse_depth.len()], inverse_depth)?;
    Ok(PyLateral { angle, variance, crlb: bound, noise_std, inv_depth })
}

#[pyfunction]
#[pyo3(name = "_motion3d_lateral_bound")]
pub fn motion3d_lateral_bound(
    py: Python<'_>,
    inverse_depth: &Bound<'_, PyAny>,
    noise_std: f64,
) -> Outcome<PyLateralBound> {
    let (shape, depths) = arrays::doubles("inv_depth", inverse_depth)?;
    if shape.len() != 1 {
        return Err(Error::argument("inv_depth", "shape (N,)", format!("shape {}", shape_text(&shape))).into());
    }
    let LateralBound { bound, likelihood, ones, shrunk, crossover } =
        py.detach(|| lateral_bound(&depths, noise_std))?;
    Ok(PyLateralBound { crlb: bound, ml_variance: likelihood, ones_variance: ones, shrunk_variance: shrunk, crossover })
}
