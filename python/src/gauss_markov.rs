//! The trackers' filter for Python; the class that a user meets is `jacoflow.track.GaussMarkovFilter`.

use super::arrays;
use crate::errors::Outcome;
use jacoflow::error::{Error, Result};
use jacoflow::track::gradient::{Dynamics, GaussMarkovFilter, Measurement, Velocity};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The compiled part of `jacoflow.track.GaussMarkovFilter`.
#[pyclass(name = "_GaussMarkovFilter", module = "jacoflow._jacoflow")]
pub struct PyGaussMarkovFilter(GaussMarkovFilter);

/// A number of one kind.
fn checked(name: &'static str, value: f64, expected: &'static str, holds: impl Fn(f64) -> bool) -> Result<f64> {
    if value.is_finite() && holds(value) { Ok(value) } else { Err(Error::argument(name, expected, value)) }
}

#[pymethods]
impl PyGaussMarkovFilter {
    #[new]
    #[pyo3(signature = (position, alpha, q, start, measures))]
    fn new(position: [f64; 2], alpha: f64, q: f64, start: [f64; 3], measures: &str) -> Outcome<Self> {
        for value in position {
            checked("position", value, "two finite numbers, px", |_| true)?;
        }
        let alpha = checked("alpha", alpha, "a correlation above 0 and at most 1", |a| a > 0.0 && a <= 1.0)?;
        let q = checked("q", q, "a variance, at least 0", |q| q >= 0.0)?;
        for variance in start {
            checked("start", variance, "three variances, at least 0", |v| v >= 0.0)?;
        }
        let velocity = match measures {
            "mean" => Velocity::Mean,
            "instant" => Velocity::AsPrinted,
            other => return Err(Error::argument("measures", "\"mean\" or \"instant\"", other).into()),
        };
        Ok(Self(GaussMarkovFilter::new(position, Dynamics { alpha, q, start }, velocity)))
    }

    /// To the next frame.
    fn predict(&mut self) {
        self.0.predict();
    }

    /// Takes a measurement: values and variances along x and y; returns its normalised innovation
    /// squared.
    #[pyo3(signature = (position, velocity))]
    fn update(
        &mut self,
        position: Option<([f64; 2], [f64; 2])>,
        velocity: Option<([f64; 2], [f64; 2])>,
    ) -> Outcome<f64> {
        for (value, variance, given) in
            [("position", "position_variance", &position), ("velocity", "velocity_variance", &velocity)]
        {
            for (z, r) in given.iter().flat_map(|(z, r)| z.iter().zip(r)) {
                checked(value, *z, "finite numbers", |_| true)?;
                checked(variance, *r, "a variance above 0", |r| r > 0.0)?;
            }
        }
        Ok(self.0.update(&Measurement { position, velocity }))
    }

    /// Position, velocity and acceleration along x and along y, (2, 3), px and frames.
    fn state<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        let values = self.0.x.iter().flat_map(|x| x.iter().copied()).collect();
        arrays::owned::<f64>(py, &[2, 3], values)
    }

    /// Everything, as a dictionary for a pickle.
    fn save<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyDict>> {
        let state = PyDict::new(py);
        state.set_item("alpha", self.0.alpha)?;
        state.set_item("q", self.0.q)?;
        state.set_item("measures", if self.0.velocity == Velocity::Mean { "mean" } else { "instant" })?;
        state.set_item("x", self.0.x.map(<[f64; 3]>::from))?;
        state.set_item("p", self.0.p.map(<[[f64; 3]; 3]>::from))?;
        Ok(state)
    }

    /// State and covariances (column by column) as they were saved.
    fn restore(&mut self, x: [[f64; 3]; 2], p: [[[f64; 3]; 3]; 2]) {
        self.0.x = x.map(Into::into);
        self.0.p = p.map(Into::into);
    }

    /// Their covariances along x and along y, (2, 3, 3).
    fn covariance<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        let values = self.0.covariance().iter().flatten().flatten().copied().collect();
        arrays::owned::<f64>(py, &[2, 3, 3], values)
    }
}
