//! `KalmanFilter`, linear.

use super::callback::{Callbacks, entry, lead, lock, read, write};
use super::gaussian::{GaussianFilter, sizes};
use super::sequence::{Record, check_each, filtered, for_each_time, items, noises, smoothed};
use crate::arrays;
use crate::errors::Outcome;
use crate::interrupt::interruptible;
use crate::options::{Integer, named};
use jacoflow::error::Error;
use jacoflow::filter::KalmanFilter as Core;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Mutex;

/// Linear Kalman filter x' = F x + w, z = H x + v with w ~ N(0, Q), v ~ N(0, R).
///
/// `dim_x` = n and `dim_z` = m dimensions; `batch` = B runs B independent filters, every array then having a
/// leading axis (B, ...). Of the functions `residual_z` and `state_add` are used, `residual_x` by the
/// smoother.
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
            return Err(Error::shape(name, &lead(batch, &tail), &shape).into());
        }
        Ok((shape, values))
    }
}

#[pymethods]
impl KalmanFilter {
    #[new]
    #[pyo3(signature = (dim_x, dim_z, *, batch=None, residual_x=None, residual_z=None, state_add=None))]
    fn new(
        py: Python<'_>,
        #[pyo3(from_py_with = named::dim_x)] dim_x: Integer,
        #[pyo3(from_py_with = named::dim_z)] dim_z: Integer,
        #[pyo3(from_py_with = named::batch)] batch: Option<Integer>,
        residual_x: Option<Py<PyAny>>,
        residual_z: Option<Py<PyAny>>,
        state_add: Option<Py<PyAny>>,
    ) -> Outcome<PyClassInitializer<Self>> {
        let (dim_x, dim_z, batch) = sizes(dim_x, dim_z, batch)?;
        let core = Core::new(batch.unwrap_or(1), dim_x, dim_z)?;
        let base = GaussianFilter::new(py, &core.state, batch, [residual_x, residual_z, state_add])?;
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

    /// Takes in the measurement `z` (m,) or (B, m), in the measurement's units: the components that are
    /// neither NaN nor masked. None means that all are missing.
    ///
    /// `R` and `H` replace the attributes for this step. NumericalError when no state has a positive definite
    /// innovation covariance. Exceptions of the functions leave x and P as they were.
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
        let (callbacks, work) = (Callbacks::default(), &mut *core);
        let mut manifold = base.manifold(py, &callbacks);
        let result = py.detach(|| work.update_on(&mut manifold, &z));
        drop(manifold);
        callbacks.finish(result)?;
        base.take(py, &core.state)
    }

    /// Filters the measurements `zs` of T times, each as `update` takes it, from the present state on.
    ///
    /// Returns means (T, n), covariances (T, n, n) after the updates and those after the predictions, in the
    /// state's units, with the batch's axis after T. `Fs`, `Qs`, `Hs`, `Rs`, sequences of T items, replace
    /// the attributes where an item is not None. With `update_first` each time is updated, then predicted.
    /// ValueError naming the sequence for a wrong number of items or shape.
    #[pyo3(signature = (zs, Fs=None, Qs=None, Hs=None, Rs=None, *, update_first=false))]
    fn batch_filter<'py>(
        slf: &Bound<'py, Self>,
        zs: &Bound<'py, PyAny>,
        Fs: Option<&Bound<'py, PyAny>>,
        Qs: Option<&Bound<'py, PyAny>>,
        Hs: Option<&Bound<'py, PyAny>>,
        Rs: Option<&Bound<'py, PyAny>>,
        #[pyo3(from_py_with = named::update_first)] update_first: bool,
    ) -> Outcome<(Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, base, zs) = (slf.py(), slf.as_super().get(), items("zs", zs)?);
        let all = |name, sequence| for_each_time(name, sequence, zs.len());
        let (Fs, Qs, Hs, Rs) = (all("Fs", Fs)?, all("Qs", Qs)?, all("Hs", Hs)?, all("Rs", Rs)?);
        let (batch, n, m) = (base.batch, base.dim_x, base.dim_z);
        check_each(&zs, |z| base.measurement_of("zs", z))?;
        check_each(Fs.iter().flatten(), |F| Self::matrix("Fs", F, batch, [n, n]))?;
        check_each(Hs.iter().flatten(), |H| Self::matrix("Hs", H, batch, [m, n]))?;
        check_each(Qs.iter().flatten(), |Q| base.noise("Qs", 2, Q))?;
        check_each(Rs.iter().flatten(), |R| base.noise("Rs", 3, R))?;
        let (mut updated, mut predicted) = (Record::default(), Record::default());
        for (k, z) in zs.iter().enumerate() {
            py.check_signals()?;
            for updates in [update_first, !update_first] {
                if updates {
                    Self::update(slf, z, Rs[k].as_ref(), Hs[k].as_ref())?;
                    updated.push(py, base)?;
                } else {
                    Self::predict(slf, Fs[k].as_ref(), Qs[k].as_ref())?;
                    predicted.push(py, base)?;
                }
            }
        }
        let ([x, P], [xp, Pp]) = (updated.arrays(py, base)?, predicted.arrays(py, base)?);
        Ok((x, P, xp, Pp))
    }

    /// Smooths filtered means `Xs` (T, n) and covariances `Ps` (T, n, n) of T times, in the state's units,
    /// with the batch's axis after T (Rauch, Tung, Striebel 1965).
    ///
    /// Returns smoothed means (T, n), covariances, gains and predicted covariances (T, n, n). Gain and
    /// prediction k are of the step from time k to k + 1; `Fs` and `Qs`, sequences of T items as in
    /// `batch_filter`, are of the step to their time. NaN where a state cannot be smoothed.
    #[pyo3(signature = (Xs, Ps, Fs=None, Qs=None))]
    fn rts_smoother<'py>(
        slf: &Bound<'py, Self>,
        Xs: &Bound<'py, PyAny>,
        Ps: &Bound<'py, PyAny>,
        Fs: Option<&Bound<'py, PyAny>>,
        Qs: Option<&Bound<'py, PyAny>>,
    ) -> Outcome<(Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, base, this) = (slf.py(), slf.as_super().get(), slf.get());
        let (times, Xs, Ps) = filtered(base, Xs, Ps)?;
        let (n, own) = (base.dim_x, this.f(py).into_bound(py));
        let Fs: Vec<Vec<f64>> = for_each_time("Fs", Fs, times)?
            .iter()
            .map(|F| Ok(Self::matrix("Fs", F.as_ref().unwrap_or(&own), base.batch, [n, n])?.1))
            .collect::<Outcome<_>>()?;
        let Qs = noises(base, Qs, times)?;
        let mut core = lock(&this.core)?;
        base.give(py, &mut core.state, None, None)?;
        let (callbacks, work) = (Callbacks::default(), &*core);
        let mut manifold = base.manifold(py, &callbacks);
        let result = interruptible(py, || Ok(work.rts_smoother(&mut manifold, (&Xs, &Ps), Some(&Fs), Qs.as_deref())))?;
        drop(manifold);
        let [x, P, K, Pp] = smoothed(py, base, times, callbacks.finish(result)?)?;
        Ok((x, P, K, Pp))
    }

    fn __repr__(slf: &Bound<'_, Self>) -> String {
        format!("KalmanFilter({})", slf.as_super().get().describe())
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
    let filter = Bound::new(py, KalmanFilter::new(py, dim_x, dim_z, batch, None, None, None)?)?;
    filter.as_super().get().restore(state)?;
    KalmanFilter::set_f(&filter, &entry(state, "F")?)?;
    KalmanFilter::set_h(&filter, &entry(state, "H")?)?;
    Ok(filter)
}
