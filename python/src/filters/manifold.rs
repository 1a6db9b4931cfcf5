//! Differences, means and sums as Python functions.

use super::callback::{Callbacks, lead};
use crate::errors::Outcome;
use jacoflow::filter::{Manifold, Vectors};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

/// The functions, in the order in which they are kept.
pub const FUNCTIONS: [&str; 5] = ["residual_x", "residual_z", "state_add", "x_mean", "z_mean"];

/// `value` if it is a function or None.
pub fn function_or_none(name: &str, value: Option<Py<PyAny>>, py: Python<'_>) -> Outcome<Py<PyAny>> {
    let value = value.unwrap_or_else(|| py.None());
    let object = value.bind(py);
    if object.is_none() || object.is_callable() {
        return Ok(value);
    }
    let got = object.get_type().name()?;
    Err(PyTypeError::new_err(format!("{name}: expected a function or None, got {got}")).into())
}

/// The functions that are there; vectors for the others.
pub struct Functions<'a> {
    /// In the order of [`FUNCTIONS`].
    pub callables: [Option<Py<PyAny>>; FUNCTIONS.len()],
    pub callbacks: &'a Callbacks,
    pub batch: Option<usize>,
    pub dims: (usize, usize),
}

impl Functions<'_> {
    /// Calls function `index` with arrays of rows of `width` values; none: `default`.
    fn of_two(
        &self,
        index: usize,
        width: usize,
        (a, b, out): (&[f64], &[f64], &mut [f64]),
        default: fn(&mut Vectors, &[f64], &[f64], &mut [f64]) -> jacoflow::Result<()>,
    ) -> jacoflow::Result<()> {
        let Some(function) = &self.callables[index] else { return default(&mut Vectors, a, b, out) };
        let shape = self.shape(a.len(), width);
        self.callbacks.call(FUNCTIONS[index], &[(&shape, a), (&shape, b)], &shape, out, |py, inputs| {
            Ok(function.bind(py).call1((&inputs[0], &inputs[1]))?)
        })
    }

    fn mean(
        &self,
        index: usize,
        width: usize,
        (points, weights, out): (&[f64], &[f64], &mut [f64]),
        default: fn(&mut Vectors, &[f64], &[f64], usize, &mut [f64]) -> jacoflow::Result<()>,
    ) -> jacoflow::Result<()> {
        let Some(function) = &self.callables[index] else { return default(&mut Vectors, points, weights, width, out) };
        let (rows, shape) = ([weights.len()], lead(self.batch, &[weights.len(), width]));
        let (inputs, shape_out) = ([(&shape[..], points), (&rows[..], weights)], lead(self.batch, &[width]));
        self.callbacks.call(FUNCTIONS[index], &inputs, &shape_out, out, |py, inputs| {
            Ok(function.bind(py).call1((&inputs[0], &inputs[1]))?)
        })
    }

    /// `(width,)`, or `(rows, width)` where there are several rows for each filter, after the batch.
    fn shape(&self, values: usize, width: usize) -> Vec<usize> {
        let rows = values / (self.batch.unwrap_or(1) * width);
        if rows == 1 { lead(self.batch, &[width]) } else { lead(self.batch, &[rows, width]) }
    }
}

impl Manifold for Functions<'_> {
    fn residual_x(&mut self, a: &[f64], b: &[f64], out: &mut [f64]) -> jacoflow::Result<()> {
        self.of_two(0, self.dims.0, (a, b, out), Vectors::residual_x)
    }
    fn residual_z(&mut self, a: &[f64], b: &[f64], out: &mut [f64]) -> jacoflow::Result<()> {
        self.of_two(1, self.dims.1, (a, b, out), Vectors::residual_z)
    }
    fn state_add(&mut self, x: &[f64], dx: &[f64], out: &mut [f64]) -> jacoflow::Result<()> {
        self.of_two(2, self.dims.0, (x, dx, out), Vectors::state_add)
    }
    fn x_mean(&mut self, points: &[f64], weights: &[f64], _: usize, out: &mut [f64]) -> jacoflow::Result<()> {
        self.mean(3, self.dims.0, (points, weights, out), Vectors::x_mean)
    }
    fn z_mean(&mut self, points: &[f64], weights: &[f64], _: usize, out: &mut [f64]) -> jacoflow::Result<()> {
        self.mean(4, self.dims.1, (points, weights, out), Vectors::z_mean)
    }
}
