//! What the three filters share: the batch of Gaussians as numpy arrays that the user may change in place.

use crate::errors::{Outcome, Raised};
use crate::{arrays, keywords::getters};
use jacoflow::error::Error;
use jacoflow::filter::{GaussianState, check_covariances, check_mean};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Mean, covariance and noise of a batch of filters, as float64 arrays.
///
/// Without `batch` arrays have no leading axis: x (n,), P (n, n), y (m,), S (m, m), K (n, m). With `batch=B`
/// they are (B, n), (B, n, n) and so on; Q and R may be shared by the whole batch. Arrays may be replaced or
/// changed in place; a number given for P, Q or R means that multiple of the identity. ValueError for an x
/// that is not finite and for a P, Q or R that is not finite, symmetric and positive semi-definite, when it
/// is set or, changed in place, at the next step. Units are the state's and the measurement's own.
#[pyclass(module = "jacoflow.filters", subclass, frozen)]
pub struct GaussianFilter {
    pub dim_x: usize,
    pub dim_z: usize,
    pub batch: Option<usize>,
    /// Locked for moments only, never while Python code runs.
    variables: Mutex<Variables>,
}

struct Variables {
    /// In the order of [`NAMES`].
    arrays: [Py<PyAny>; NAMES.len()],
    repairs: u64,
}

/// Attributes that are arrays.
const NAMES: [&str; 8] = ["x", "P", "Q", "R", "y", "S", "K", "log_likelihood"];

impl GaussianFilter {
    /// The arrays of a new core state.
    pub fn new(py: Python<'_>, state: &GaussianState, batch: Option<usize>) -> Outcome<Self> {
        let variables = Variables { arrays: std::array::from_fn(|_| py.None()), repairs: 0 };
        let filter = Self { dim_x: state.dim_x, dim_z: state.dim_z, batch, variables: Mutex::new(variables) };
        filter.set(2, arrays::owned(py, &[state.dim_x; 2], state.Q.clone())?.unbind());
        filter.set(3, arrays::owned(py, &[state.dim_z; 2], state.R.clone())?.unbind());
        filter.take(py, state)?;
        Ok(filter)
    }

    fn variables(&self) -> MutexGuard<'_, Variables> {
        self.variables.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn get(&self, py: Python<'_>, index: usize) -> Py<PyAny> {
        self.variables().arrays[index].clone_ref(py)
    }

    fn set(&self, index: usize, array: Py<PyAny>) {
        let old = std::mem::replace(&mut self.variables().arrays[index], array);
        drop(old);
    }

    /// Trailing shape of array `index`.
    fn tail(&self, index: usize) -> Vec<usize> {
        let (n, m) = (self.dim_x, self.dim_z);
        match index {
            0 => vec![n],
            1 | 2 => vec![n, n],
            3 | 5 => vec![m, m],
            4 => vec![m],
            6 => vec![n, m],
            _ => vec![],
        }
    }

    /// Full shape of array `index`.
    fn shape(&self, index: usize) -> Vec<usize> {
        self.batch.into_iter().chain(self.tail(index)).collect()
    }

    /// Copies what the user may have changed into the core state, with the noise of this step if it has its
    /// own.
    pub fn give(
        &self,
        py: Python<'_>,
        state: &mut GaussianState,
        Q: Option<&Bound<'_, PyAny>>,
        R: Option<&Bound<'_, PyAny>>,
    ) -> Outcome<()> {
        state.x = self.read(py, 0)?;
        state.P = self.read(py, 1)?;
        for (index, noise, target) in [(2, Q, &mut state.Q), (3, R, &mut state.R)] {
            *target = match noise {
                Some(noise) => arrays::doubles(NAMES[index], self.covariance(index, noise)?.bind(py))?.1,
                None => self.read(py, index)?,
            };
        }
        Ok(())
    }

    /// New arrays with the core's results; arrays handed out before keep their values.
    pub fn take(&self, py: Python<'_>, state: &GaussianState) -> Outcome<()> {
        let results =
            [(0, &state.x), (1, &state.P), (4, &state.y), (5, &state.S), (6, &state.K), (7, &state.log_likelihood)];
        for (index, values) in results {
            self.set(index, arrays::owned(py, &self.shape(index), values.clone())?.unbind());
        }
        self.variables().repairs = state.repairs;
        Ok(())
    }

    fn read(&self, py: Python<'_>, index: usize) -> Outcome<Vec<f64>> {
        let (shape, values) = arrays::doubles(NAMES[index], self.get(py, index).bind(py))?;
        let shared = matches!(index, 2 | 3) && shape == self.tail(index);
        if !shared && shape != self.shape(index) {
            return Err(self.wrong(index, &shape));
        }
        Ok(values)
    }

    fn wrong(&self, index: usize, got: &[usize]) -> Raised {
        Error::argument(NAMES[index], format!("shape {:?}", self.shape(index)), format!("shape {got:?}")).into()
    }

    /// `value` for array `index`: a copy, spread over the batch; a number for a covariance is a multiple of
    /// the identity.
    pub fn covariance(&self, index: usize, value: &Bound<'_, PyAny>) -> Outcome<Py<PyAny>> {
        let py = value.py();
        let numpy = py.import("numpy")?;
        let (mut shape, mut values) = arrays::doubles(NAMES[index], value)?;
        let tail = self.tail(index);
        if let (true, [size, _]) = (shape.is_empty(), tail.as_slice()) {
            let identity = numpy.call_method1("identity", (*size,))?;
            let scaled = numpy.call_method1("multiply", (identity, values[0]))?;
            (shape, values) = arrays::doubles(NAMES[index], &scaled)?;
        }
        if shape != tail && shape != self.shape(index) {
            return Err(self.wrong(index, &shape));
        }
        match index {
            0 => check_mean(&values)?,
            1..=3 => check_covariances(NAMES[index], &values, tail[0])?,
            _ => {}
        }
        if matches!(index, 0 | 1) && shape == tail {
            values = values.repeat(self.batch.unwrap_or(1));
            shape = self.shape(index);
        }
        Ok(arrays::owned(py, &shape, values)?.unbind())
    }

    /// Measurements `(m,)` or `(B, m)`; `None` is a missing one, a number is taken for `m = 1`.
    pub fn measurement(&self, z: &Bound<'_, PyAny>) -> Outcome<Vec<f64>> {
        let total = self.batch.unwrap_or(1) * self.dim_z;
        if z.is_none() {
            return Ok(vec![f64::NAN; total]);
        }
        let (shape, values) = arrays::doubles("z", z)?;
        let scalar = shape.is_empty() && total == 1;
        if !scalar && shape != self.shape(4) {
            let got = format!("shape {shape:?}");
            return Err(Error::argument("z", format!("shape {:?}", self.shape(4)), got).into());
        }
        Ok(values)
    }

    /// What pickling needs of this part.
    pub fn save<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyDict>> {
        let state = PyDict::new(py);
        for (index, name) in NAMES.iter().enumerate() {
            state.set_item(name, self.get(py, index))?;
        }
        state.set_item("repairs", self.variables().repairs)?;
        Ok(state)
    }

    /// The inverse of [`Self::save`].
    pub fn restore(&self, state: &Bound<'_, PyDict>) -> Outcome<()> {
        for (index, name) in NAMES.iter().enumerate() {
            let value =
                state.get_item(name)?.ok_or_else(|| Error::argument("state", format!("the entry {name:?}"), "none"))?;
            self.set(index, self.covariance(index, &value)?);
        }
        let repairs = state.get_item("repairs")?.map_or(Ok(0), |value| value.extract())?;
        self.variables().repairs = repairs;
        Ok(())
    }
}

getters! {
    GaussianFilter;
    /// Mean, array (n,) or (B, n), in the state's units.
    x(this, slf) -> Py<PyAny> = this.get(slf.py(), 0);
    /// Covariance, array (n, n) or (B, n, n), in the state's units squared.
    P(this, slf) -> Py<PyAny> = this.get(slf.py(), 1);
    /// Process noise covariance, array (n, n) or (B, n, n), in the state's units squared per step.
    Q(this, slf) -> Py<PyAny> = this.get(slf.py(), 2);
    /// Measurement noise covariance, array (m, m) or (B, m, m), in the measurement's units squared.
    R(this, slf) -> Py<PyAny> = this.get(slf.py(), 3);
    /// Residual of the last update, array (m,) or (B, m), in the measurement's units; zero where the
    /// measurement was missing.
    y(this, slf) -> Py<PyAny> = this.get(slf.py(), 4);
    /// Covariance of the residual, array (m, m) or (B, m, m), in the measurement's units squared.
    S(this, slf) -> Py<PyAny> = this.get(slf.py(), 5);
    /// Gain of the last update, array (n, m) or (B, n, m), state units per measurement unit.
    K(this, slf) -> Py<PyAny> = this.get(slf.py(), 6);
    /// Logarithm of the last measurement's likelihood, array () or (B,), no unit.
    log_likelihood(this, slf) -> Py<PyAny> = this.get(slf.py(), 7);
    /// How often a covariance had lost its positive definiteness and was repaired (a count, no unit).
    repairs(this) -> u64 = this.variables().repairs;
    /// Dimensions n of the state (a count, no unit).
    dim_x(this) -> usize = this.dim_x;
    /// Dimensions m of the measurement (a count, no unit).
    dim_z(this) -> usize = this.dim_z;
    /// Number B of independent filters, or None where arrays have no leading axis (a count, no unit).
    batch(this) -> Option<usize> = this.batch;
}

#[pymethods]
impl GaussianFilter {
    #[setter]
    fn set_x(&self, value: &Bound<'_, PyAny>) -> Outcome<()> {
        self.set(0, self.covariance(0, value)?);
        Ok(())
    }
    #[setter(P)]
    fn set_p(&self, value: &Bound<'_, PyAny>) -> Outcome<()> {
        self.set(1, self.covariance(1, value)?);
        Ok(())
    }
    #[setter(Q)]
    fn set_q(&self, value: &Bound<'_, PyAny>) -> Outcome<()> {
        self.set(2, self.covariance(2, value)?);
        Ok(())
    }
    #[setter(R)]
    fn set_r(&self, value: &Bound<'_, PyAny>) -> Outcome<()> {
        self.set(3, self.covariance(3, value)?);
        Ok(())
    }
}
