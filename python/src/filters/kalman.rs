//! `KalmanFilter`, linear.

use super::callback::{entry, lead, lock, read, write};
use super::gaussian::GaussianFilter;
use crate::arrays;
use crate::errors::Outcome;
use jacoflow::error::Error;
use jacoflow::filter::KalmanFilter as Core;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Mutex;

/// Linear Kalman filter x' = F x + w, z = H x + v with w ~ N(0, Q), v ~ N(0, R).
///
/// `dim_x` = n and `dim_z` = m dimensions; `batch` = B runs B independent filters, every array then having a
/// leading axis (B, ...).
#[pyclass(module = "jacoflow.filters", extends = GaussianFilter, frozen)]
pub struct KalmanFilter {
    core: Mutex<Core>,
    f: Mutex<Py<PyAny>>,
    h: Mutex<Py<PyAny>>,
}

impl KalmanFilter {
    /// A copy of a matrix `(rows, n)` or `(B, rows, n)`.
    fn matrix(
        name: &'static str,
        value: &Bound<'_, PyAny>,
        batch: Option<usize>,
        tail: [usize; 2],
    ) -> Outcome<(Vec<usize>, Vec<f64>)> {
        let (shape, values) = arrays::doubles(name, value)?;
        if shape != tail && shape != lead(batch, &tail) {
            return Err(
                Error::argument(name, format!("shape {:?}", lead(batch, &tail)), format!("shape {shape:?}")).into()
            );
        }
        Ok((shape, values))
    }
}

#[pymethods]
impl KalmanFilter {
    #[new]
    #[pyo3(signature = (dim_x, dim_z, *, batch=None))]
    fn new(py: Python<'_>, dim_x: usize, dim_z: usize, batch: Option<usize>) -> Outcome<PyClassInitializer<Self>> {
        let core = Core::new(batch.unwrap_or(1), dim_x, dim_z)?;
        let base = GaussianFilter::new(py, &core.state, batch)?;
        let f = arrays::owned(py, &[dim_x, dim_x], core.F.clone())?.unbind();
        let h = arrays::owned(py, &[dim_z, dim_x], core.H.clone())?.unbind();
        Ok(PyClassInitializer::from(base).add_subclass(Self {
            core: Mutex::new(core),
            f: Mutex::new(f),
            h: Mutex::new(h),
        }))
    }

    /// Transition matrix, array (n, n) or (B, n, n), in the state's units; identity at first.
    #[getter(F)]
    fn f(&self, py: Python<'_>) -> Py<PyAny> {
        read(py, &self.f)
    }
    #[setter(F)]
    fn set_f(slf: &Bound<'_, Self>, value: &Bound<'_, PyAny>) -> Outcome<()> {
        let base = slf.as_super().get();
        let (batch, n) = (base.batch, base.dim_x);
        let (shape, values) = Self::matrix("F", value, batch, [n, n])?;
        write(&slf.get().f, arrays::owned(slf.py(), &shape, values)?.unbind());
        Ok(())
    }
    /// Measurement matrix, array (m, n) or (B, m, n), measurement units per state unit; zero at first.
    #[getter(H)]
    fn h(&self, py: Python<'_>) -> Py<PyAny> {
        read(py, &self.h)
    }
    #[setter(H)]
    fn set_h(slf: &Bound<'_, Self>, value: &Bound<'_, PyAny>) -> Outcome<()> {
        let base = slf.as_super().get();
        let (batch, n, m) = (base.batch, base.dim_x, base.dim_z);
        let (shape, values) = Self::matrix("H", value, batch, [m, n])?;
        write(&slf.get().h, arrays::owned(slf.py(), &shape, values)?.unbind());
        Ok(())
    }

    /// x <- F x, P <- F P F^T + Q. `F` (n, n) or (B, n, n) and `Q` replace the attributes for this step.
    #[pyo3(signature = (*, F=None, Q=None))]
    fn predict(slf: &Bound<'_, Self>, F: Option<&Bound<'_, PyAny>>, Q: Option<&Bound<'_, PyAny>>) -> Outcome<()> {
        let (py, base, this) = (slf.py(), slf.as_super().get(), slf.get());
        let mut core = lock(&this.core)?;
        base.give(py, &mut core.state, Q, None)?;
        let n = base.dim_x;
        core.F = Self::matrix("F", F.unwrap_or(this.f(py).bind(py)), base.batch, [n, n])?.1;
        let core = &mut *core;
        py.detach(|| core.predict())?;
        base.take(py, &core.state)
    }

    /// Takes in the measurement `z` (m,) or (B, m), in the measurement's units; None and NaN mean a missing
    /// one.
    ///
    /// `R` and `H` replace the attributes for this step. NumericalError when the innovation covariance is not
    /// positive definite.
    #[pyo3(signature = (z, R=None, H=None))]
    fn update(
        slf: &Bound<'_, Self>,
        z: &Bound<'_, PyAny>,
        R: Option<&Bound<'_, PyAny>>,
        H: Option<&Bound<'_, PyAny>>,
    ) -> Outcome<()> {
        let (py, base, this) = (slf.py(), slf.as_super().get(), slf.get());
        let mut core = lock(&this.core)?;
        let z = base.measurement(z)?;
        base.give(py, &mut core.state, None, R)?;
        let (n, m) = (base.dim_x, base.dim_z);
        core.H = Self::matrix("H", H.unwrap_or(this.h(py).bind(py)), base.batch, [m, n])?.1;
        let core = &mut *core;
        py.detach(|| core.update(&z))?;
        base.take(py, &core.state)
    }

    fn __repr__(slf: &Bound<'_, Self>) -> String {
        let base = slf.as_super().get();
        let batch = base.batch.map_or("None".to_owned(), |b| b.to_string());
        format!("KalmanFilter(dim_x={}, dim_z={}, batch={batch})", base.dim_x, base.dim_z)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Outcome<(Bound<'py, PyAny>, (Bound<'py, PyDict>,))> {
        let (py, base, this) = (slf.py(), slf.as_super().get(), slf.get());
        let state = base.save(py)?;
        state.set_item("arguments", (base.dim_x, base.dim_z, base.batch))?;
        state.set_item("F", read(py, &this.f))?;
        state.set_item("H", read(py, &this.h))?;
        Ok((py.import("jacoflow._jacoflow")?.getattr("_restore_kalman")?, (state,)))
    }
}

/// The inverse of `KalmanFilter.__reduce__`.
#[pyfunction(name = "_restore_kalman")]
pub fn restore_kalman<'py>(py: Python<'py>, state: &Bound<'py, PyDict>) -> Outcome<Bound<'py, KalmanFilter>> {
    let (dim_x, dim_z, batch) = entry(state, "arguments")?.extract()?;
    let filter = Bound::new(py, KalmanFilter::new(py, dim_x, dim_z, batch)?)?;
    filter.as_super().get().restore(state)?;
    KalmanFilter::set_f(&filter, &entry(state, "F")?)?;
    KalmanFilter::set_h(&filter, &entry(state, "H")?)?;
    Ok(filter)
}
