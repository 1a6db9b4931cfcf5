//! What the three filters share: the batch of Gaussians as numpy arrays that the user may change in place.

use super::callback::{Callbacks, entry};
use super::manifold::{FUNCTIONS, Functions, function_or_none};
use crate::errors::Outcome;
use crate::options::{Integer, count};
use crate::{arrays, keywords::getters};
use jacoflow::error::Error;
use jacoflow::filter::{GaussianState, check_covariances, check_mean};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Mean, covariance and noise of a batch of filters, as float64 arrays.
///
/// Without `batch` arrays have no leading axis: x (n,), P (n, n), y (m,), S (m, m), K (n, m). With `batch=B`
/// they are (B, n), (B, n, n) and so on; Q and R may be shared by the whole batch. Arrays may be replaced or
/// changed in place; a number given for P, Q or R means that multiple of the identity. ValueError for an x
/// that is not finite and for a P, Q or R that is not finite, symmetric and positive semi-definite, when it
/// is set or, changed in place, at the next step. Units are the state's and the measurement's own.
///
/// A state that cannot make a step is left as it was and marked in `failed`; an error is raised only when all
/// are. For angles and other quantities that are no vectors, `residual_x`, `residual_z` and `state_add`
/// replace differences and sums; None means those of vectors. Like all functions they are vectorised.
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
    /// In the order of [`FUNCTIONS`]; None: those of vectors.
    functions: [Py<PyAny>; FUNCTIONS.len()],
    failed: Vec<bool>,
    repairs: u64,
}

/// Attributes that are arrays.
const NAMES: [&str; 9] = ["x", "P", "Q", "R", "y", "S", "K", "log_likelihood", "mahalanobis"];

/// The dimensions and the batch as numbers.
pub fn sizes(dim_x: Integer, dim_z: Integer, batch: Option<Integer>) -> Outcome<(usize, usize, Option<usize>)> {
    let batch = batch.map(|batch| count("batch", batch)).transpose()?;
    Ok((count("dim_x", dim_x)?, count("dim_z", dim_z)?, batch))
}

impl GaussianFilter {
    /// The arrays of a new core state, and the first of [`FUNCTIONS`].
    pub fn new<const N: usize>(
        py: Python<'_>,
        state: &GaussianState,
        batch: Option<usize>,
        functions: [Option<Py<PyAny>>; N],
    ) -> Outcome<Self> {
        let variables = Variables {
            arrays: std::array::from_fn(|_| py.None()),
            functions: std::array::from_fn(|_| py.None()),
            failed: state.failed.clone(),
            repairs: 0,
        };
        let filter = Self { dim_x: state.dim_x, dim_z: state.dim_z, batch, variables: Mutex::new(variables) };
        filter.set(2, arrays::owned(py, &[state.dim_x; 2], state.Q.clone())?.unbind());
        filter.set(3, arrays::owned(py, &[state.dim_z; 2], state.R.clone())?.unbind());
        filter.take(py, state)?;
        filter.set_functions(py, functions)?;
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

    /// Replaces function `index`.
    pub fn set_function(&self, py: Python<'_>, index: usize, function: Option<Py<PyAny>>) -> Outcome<()> {
        let function = function_or_none(FUNCTIONS[index], function, py)?;
        let old = std::mem::replace(&mut self.variables().functions[index], function);
        drop(old);
        Ok(())
    }

    fn set_functions(&self, py: Python<'_>, functions: impl IntoIterator<Item = Option<Py<PyAny>>>) -> Outcome<()> {
        functions.into_iter().enumerate().try_for_each(|(index, function)| self.set_function(py, index, function))
    }

    pub fn function(&self, py: Python<'_>, index: usize) -> Py<PyAny> {
        self.variables().functions[index].clone_ref(py)
    }

    /// The functions for one step.
    pub fn manifold<'a>(&self, py: Python<'_>, callbacks: &'a Callbacks) -> Functions<'a> {
        let callables = std::array::from_fn(|index| Some(self.function(py, index)).filter(|f| !f.is_none(py)));
        Functions { callables, callbacks, batch: self.batch, dims: (self.dim_x, self.dim_z) }
    }

    /// Full shape of array `index`.
    pub fn shape(&self, index: usize) -> Vec<usize> {
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
        state.failed.clone_from(&self.variables().failed);
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
        let results = [
            (0, &state.x),
            (1, &state.P),
            (4, &state.y),
            (5, &state.S),
            (6, &state.K),
            (7, &state.log_likelihood),
            (8, &state.mahalanobis),
        ];
        for (index, values) in results {
            self.set(index, arrays::owned(py, &self.shape(index), values.clone())?.unbind());
        }
        let mut variables = self.variables();
        variables.repairs = state.repairs;
        variables.failed.clone_from(&state.failed);
        Ok(())
    }

    /// The values of array `index`.
    pub fn read(&self, py: Python<'_>, index: usize) -> Outcome<Vec<f64>> {
        let (shape, values) = arrays::doubles(NAMES[index], self.get(py, index).bind(py))?;
        let shared = matches!(index, 2 | 3) && shape == self.tail(index);
        if !shared && shape != self.shape(index) {
            return Err(Error::shape(NAMES[index], &self.shape(index), &shape).into());
        }
        Ok(values)
    }

    /// `value` for array `index`: a copy, spread over the batch; a number for a covariance is a multiple of
    /// the identity.
    pub fn covariance(&self, index: usize, value: &Bound<'_, PyAny>) -> Outcome<Py<PyAny>> {
        self.noise(NAMES[index], index, value)
    }

    /// As [`Self::covariance`], of an argument called `name`.
    pub fn noise(&self, name: &'static str, index: usize, value: &Bound<'_, PyAny>) -> Outcome<Py<PyAny>> {
        let py = value.py();
        let numpy = py.import("numpy")?;
        let (mut shape, mut values) = arrays::doubles(name, value)?;
        let tail = self.tail(index);
        if let (true, [size, _]) = (shape.is_empty(), tail.as_slice()) {
            let identity = numpy.call_method1("identity", (*size,))?;
            let scaled = numpy.call_method1("multiply", (identity, values[0]))?;
            (shape, values) = arrays::doubles(name, &scaled)?;
        }
        if shape != tail && shape != self.shape(index) {
            return Err(Error::shape(name, &self.shape(index), &shape).into());
        }
        match index {
            0 => check_mean(&values)?,
            1..=3 => check_covariances(name, &values, tail[0])?,
            _ => {}
        }
        if matches!(index, 0 | 1) && shape == tail {
            values = values.repeat(self.batch.unwrap_or(1));
            shape = self.shape(index);
        }
        Ok(arrays::owned(py, &shape, values)?.unbind())
    }

    /// Measurements `(m,)` or `(B, m)`; `None` is a missing one, as are masked components; a number is taken
    /// for `m = 1`.
    pub fn measurement(&self, z: &Bound<'_, PyAny>) -> Outcome<Vec<f64>> {
        self.measurement_of("z", z)
    }

    /// As [`Self::measurement`], of an argument called `name`.
    pub fn measurement_of(&self, name: &'static str, z: &Bound<'_, PyAny>) -> Outcome<Vec<f64>> {
        let total = self.batch.unwrap_or(1) * self.dim_z;
        if z.is_none() {
            return Ok(vec![f64::NAN; total]);
        }
        let masked = z.hasattr("mask")?;
        let (shape, mut values) = arrays::doubles(name, &if masked { z.getattr("data")? } else { z.clone() })?;
        if masked {
            let mask = z.py().import("numpy.ma")?.call_method1("getmaskarray", (z,))?;
            let mask = arrays::elements::<bool>(&arrays::as_array(name, &mask)?).unwrap_or_default();
            values.iter_mut().zip(mask).filter(|(_, is_missing)| *is_missing).for_each(|(z, _)| *z = f64::NAN);
        }
        let scalar = shape.is_empty() && total == 1;
        if !scalar && shape != self.shape(4) {
            return Err(Error::shape(name, &self.shape(4), &shape).into());
        }
        Ok(values)
    }

    /// What pickling needs of this part.
    pub fn save<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyDict>> {
        let state = PyDict::new(py);
        for (index, name) in NAMES.iter().enumerate() {
            state.set_item(name, self.get(py, index))?;
        }
        state.set_item("functions", PyTuple::new(py, &self.variables().functions)?)?;
        state.set_item("failed", self.variables().failed.clone())?;
        state.set_item("repairs", self.variables().repairs)?;
        Ok(state)
    }

    /// The inverse of [`Self::save`].
    pub fn restore(&self, state: &Bound<'_, PyDict>) -> Outcome<()> {
        for (index, name) in NAMES.iter().enumerate() {
            self.set(index, self.covariance(index, &entry(state, name)?)?);
        }
        let functions: [Option<Py<PyAny>>; FUNCTIONS.len()] = entry(state, "functions")?.extract()?;
        self.set_functions(state.py(), functions)?;
        let failed: Vec<bool> = entry(state, "failed")?.extract()?;
        let repairs = entry(state, "repairs")?.extract()?;
        let mut variables = self.variables();
        if failed.len() != variables.failed.len() {
            let expected = format!("{} values of failed", variables.failed.len());
            return Err(Error::argument("state", expected, failed.len()).into());
        }
        (variables.failed, variables.repairs) = (failed, repairs);
        Ok(())
    }

    /// The arguments that all filters have, as in a call.
    pub fn describe(&self) -> String {
        let batch = self.batch.map_or("None".to_owned(), |b| b.to_string());
        format!("dim_x={}, dim_z={}, batch={batch}", self.dim_x, self.dim_z)
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
    /// Residual of the last update, array (m,) or (B, m), in the measurement's units; zero where a component
    /// was missing, as in S and K.
    y(this, slf) -> Py<PyAny> = this.get(slf.py(), 4);
    /// Covariance of the residual, array (m, m) or (B, m, m), in the measurement's units squared.
    S(this, slf) -> Py<PyAny> = this.get(slf.py(), 5);
    /// Gain of the last update, array (n, m) or (B, n, m), state units per measurement unit.
    K(this, slf) -> Py<PyAny> = this.get(slf.py(), 6);
    /// Logarithm of the likelihood of the last measurement's components that were there, array () or (B,), no
    /// unit; zero without any.
    log_likelihood(this, slf) -> Py<PyAny> = this.get(slf.py(), 7);
    /// Mahalanobis distance sqrt(y^T S^-1 y) of the last measurement, array () or (B,), in standard
    /// deviations; zero where it was missing.
    mahalanobis(this, slf) -> Py<PyAny> = this.get(slf.py(), 8);
    /// Whether a step could not be carried out for a state, since P was last assigned: bool array () or
    /// (B,), no unit. The state was left as it was before that step.
    failed(this, slf) -> Outcome<Bound<'py, PyAny>> = {
        let failed = this.variables().failed.clone();
        arrays::owned(slf.py(), &this.shape(7), failed)
    };
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
        self.variables().failed.fill(false);
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
    /// Difference `residual_x(a, b)` of states, arrays (..., n) of one shape -> (..., n), in the state's
    /// units; None: a - b.
    #[getter]
    fn residual_x(&self, py: Python<'_>) -> Py<PyAny> {
        self.function(py, 0)
    }
    #[setter]
    fn set_residual_x(&self, py: Python<'_>, value: Option<Py<PyAny>>) -> Outcome<()> {
        self.set_function(py, 0, value)
    }
    /// Difference `residual_z(a, b)` of measurements, arrays (..., m) of one shape -> (..., m), in the
    /// measurement's units; None: a - b.
    #[getter]
    fn residual_z(&self, py: Python<'_>) -> Py<PyAny> {
        self.function(py, 1)
    }
    #[setter]
    fn set_residual_z(&self, py: Python<'_>, value: Option<Py<PyAny>>) -> Outcome<()> {
        self.set_function(py, 1, value)
    }
    /// Sum `state_add(x, dx)` of a state and a difference, arrays (n,) or (B, n) -> the same shape, in the
    /// state's units; None: x + dx.
    #[getter]
    fn state_add(&self, py: Python<'_>) -> Py<PyAny> {
        self.function(py, 2)
    }
    #[setter]
    fn set_state_add(&self, py: Python<'_>, value: Option<Py<PyAny>>) -> Outcome<()> {
        self.set_function(py, 2, value)
    }
}
