//! `ExtendedKalmanFilter`.

use super::callback::{Callbacks, entry, lead, lock};
use super::gaussian::{GaussianFilter, sizes};
use super::sequence::{Record, check_each, filtered, for_each_time, items, noises, smoothed};
use crate::errors::Outcome;
use crate::options::{Function, Integer, named};
use jacoflow::filter::ExtendedFilter as Core;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Mutex;

/// Extended Kalman filter x' = f(x) + w, z = h(x) + v, linearised at the mean.
///
/// `dim_x` = n and `dim_z` = m dimensions; `batch` = B runs B independent filters, every array then having a
/// leading axis (B, ...). Functions are vectorised over leading axes: `fx` and `Hx` map (..., n) to (..., n)
/// and (..., m); `FJacobian` and `HJacobian` map the means (n,) or (B, n) to (n, n) or (B, n, n) and (m, n)
/// or (B, m, n). Without a Jacobian central differences are taken. `residual_z` and `state_add` serve the
/// update, `residual_x` and `residual_z` the central differences, `residual_x` the smoother.
#[pyclass(module = "jacoflow.filters", extends = GaussianFilter, frozen)]
pub struct ExtendedKalmanFilter {
    core: Mutex<Core>,
}

/// Calls `function` on rows of states that have `rows` rows for each filter (1: the means themselves, without
/// that axis).
fn on_rows(
    callbacks: &Callbacks,
    name: &'static str,
    function: &Function,
    batch: Option<usize>,
    (n, width): (usize, usize),
    (points, out): (&[f64], &mut [f64]),
) -> jacoflow::Result<()> {
    let rows = points.len() / (batch.unwrap_or(1) * n);
    let shape = |width: usize| if rows == 1 { lead(batch, &[width]) } else { lead(batch, &[rows, width]) };
    callbacks.call(name, &[(&shape(n), points)], &shape(width), out, |py, inputs| {
        Ok(function.0.bind(py).call1((&inputs[0],))?)
    })
}

#[pymethods]
impl ExtendedKalmanFilter {
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
        Ok(PyClassInitializer::from(base).add_subclass(Self { core: Mutex::new(core) }))
    }

    /// x <- fx(x), P <- F P F^T + Q with F = `FJacobian(x)`, arrays (n,) and (n, n) or with a leading (B,
    /// ...), in the state's units.
    ///
    /// Exceptions of the functions leave x and P as they were.
    #[pyo3(signature = (fx, FJacobian=None))]
    fn predict(
        slf: &Bound<'_, Self>,
        #[pyo3(from_py_with = named::fx)] fx: Function,
        #[pyo3(from_py_with = named::FJacobian)] FJacobian: Option<Function>,
    ) -> Outcome<()> {
        let (py, base) = (slf.py(), slf.as_super().get());
        let mut core = lock(&slf.get().core)?;
        base.give(py, &mut core.state, None, None)?;
        let (batch, n, callbacks, work) = (base.batch, base.dim_x, Callbacks::default(), &mut *core);
        let mut manifold = base.manifold(py, &callbacks);
        let result = py.detach(|| {
            let step = |points: &[f64], out: &mut [f64]| on_rows(&callbacks, "fx", &fx, batch, (n, n), (points, out));
            match &FJacobian {
                None => work.predict_by_differences_on(&mut manifold, step),
                Some(jacobian) => work.predict(step, |means, out| {
                    let (shape_in, shape_out) = (lead(batch, &[n]), lead(batch, &[n, n]));
                    callbacks.call("FJacobian", &[(&shape_in, means)], &shape_out, out, |py, inputs| {
                        Ok(jacobian.0.bind(py).call1((&inputs[0],))?)
                    })
                }),
            }
        });
        drop(manifold);
        callbacks.finish(result)?;
        base.take(py, &core.state)
    }

    /// Takes in the measurement `z` (m,) or (B, m), in the measurement's units: the components that are
    /// neither NaN nor masked. None means that all are missing.
    ///
    /// `HJacobian` None takes central differences of `Hx`. `R` replaces the attribute for this step.
    /// Exceptions of the functions leave x and P as they were.
    #[pyo3(signature = (z, HJacobian, Hx, R=None))]
    fn update(
        slf: &Bound<'_, Self>,
        z: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = named::HJacobian)] HJacobian: Option<Function>,
        #[pyo3(from_py_with = named::Hx)] Hx: Function,
        R: Option<&Bound<'_, PyAny>>,
    ) -> Outcome<()> {
        let (py, base) = (slf.py(), slf.as_super().get());
        let z = base.measurement(z)?;
        let mut core = lock(&slf.get().core)?;
        base.give(py, &mut core.state, None, R)?;
        let (batch, n, m, callbacks, work) = (base.batch, base.dim_x, base.dim_z, Callbacks::default(), &mut *core);
        let mut manifold = base.manifold(py, &callbacks);
        let result = py.detach(|| {
            let measure =
                |points: &[f64], out: &mut [f64]| on_rows(&callbacks, "Hx", &Hx, batch, (n, m), (points, out));
            match &HJacobian {
                None => work.update_by_differences_on(&mut manifold, &z, measure),
                Some(jacobian) => work.update_on(&mut manifold, &z, measure, |means, out| {
                    let (shape_in, shape_out) = (lead(batch, &[n]), lead(batch, &[m, n]));
                    callbacks.call("HJacobian", &[(&shape_in, means)], &shape_out, out, |py, inputs| {
                        Ok(jacobian.0.bind(py).call1((&inputs[0],))?)
                    })
                }),
            }
        });
        drop(manifold);
        callbacks.finish(result)?;
        base.take(py, &core.state)
    }

    /// Filters the measurements `zs` of T times, each as `update` takes it, from the present state on;
    /// functions as in `predict` and `update`.
    ///
    /// Returns means (T, n) and covariances (T, n, n), in the state's units, with the batch's axis after T.
    /// `Rs`, a sequence of T items, replaces R where an item is not None.
    #[pyo3(signature = (zs, fx, HJacobian, Hx, FJacobian=None, *, Rs=None))]
    fn batch_filter<'py>(
        slf: &Bound<'py, Self>,
        zs: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = named::fx)] fx: Function,
        #[pyo3(from_py_with = named::HJacobian)] HJacobian: Option<Function>,
        #[pyo3(from_py_with = named::Hx)] Hx: Function,
        #[pyo3(from_py_with = named::FJacobian)] FJacobian: Option<Function>,
        Rs: Option<&Bound<'py, PyAny>>,
    ) -> Outcome<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, base, zs) = (slf.py(), slf.as_super().get(), items("zs", zs)?);
        let (Rs, mut record) = (for_each_time("Rs", Rs, zs.len())?, Record::default());
        check_each(&zs, |z| base.measurement_of("zs", z))?;
        check_each(Rs.iter().flatten(), |R| base.noise("Rs", 3, R))?;
        let copy = |function: &Option<Function>| function.as_ref().map(|function| function.clone_ref(py));
        for (z, R) in zs.iter().zip(&Rs) {
            py.check_signals()?;
            Self::predict(slf, fx.clone_ref(py), copy(&FJacobian))?;
            Self::update(slf, z, copy(&HJacobian), Hx.clone_ref(py), R.as_ref())?;
            record.push(py, base)?;
        }
        let [x, P] = record.arrays(py, base)?;
        Ok((x, P))
    }

    /// Smooths filtered means `Xs` (T, n) and covariances `Ps` (T, n, n) of T times, in the state's units,
    /// with the batch's axis after T; functions as in `predict`.
    ///
    /// Returns smoothed means (T, n), covariances and gains (T, n, n); gain k is from time k + 1 to k.
    /// `Qs`, a sequence of T items, are of the step to their time. NaN where a state cannot be smoothed.
    #[pyo3(signature = (Xs, Ps, fx, FJacobian=None, *, Qs=None))]
    fn rts_smoother<'py>(
        slf: &Bound<'py, Self>,
        Xs: &Bound<'py, PyAny>,
        Ps: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = named::fx)] fx: Function,
        #[pyo3(from_py_with = named::FJacobian)] FJacobian: Option<Function>,
        Qs: Option<&Bound<'py, PyAny>>,
    ) -> Outcome<(Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, base) = (slf.py(), slf.as_super().get());
        let (times, Xs, Ps) = filtered(base, Xs, Ps)?;
        let Qs = noises(base, Qs, times)?;
        let mut core = lock(&slf.get().core)?;
        base.give(py, &mut core.state, None, None)?;
        let (batch, n, callbacks, work) = (base.batch, base.dim_x, Callbacks::default(), &*core);
        let mut manifold = base.manifold(py, &callbacks);
        let result = py.detach(|| {
            let step = |_: usize, points: &[f64], out: &mut [f64]| {
                on_rows(&callbacks, "fx", &fx, batch, (n, n), (points, out))
            };
            let jacobian = FJacobian.as_ref().map(|jacobian| {
                |_: usize, means: &[f64], out: &mut [f64]| {
                    let (shape_in, shape_out) = (lead(batch, &[n]), lead(batch, &[n, n]));
                    callbacks.call("FJacobian", &[(&shape_in, means)], &shape_out, out, |py, inputs| {
                        Ok(jacobian.0.bind(py).call1((&inputs[0],))?)
                    })
                }
            });
            work.rts_smoother(&mut manifold, (&Xs, &Ps), Qs.as_deref(), step, jacobian)
        });
        drop(manifold);
        let [x, P, K, _] = smoothed(py, base, times, callbacks.finish(result)?)?;
        Ok((x, P, K))
    }

    fn __repr__(slf: &Bound<'_, Self>) -> String {
        format!("ExtendedKalmanFilter({})", slf.as_super().get().describe())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Outcome<(Bound<'py, PyAny>, (Bound<'py, PyDict>,))> {
        let (py, base) = (slf.py(), slf.as_super().get());
        let state = base.save(py)?;
        state.set_item("arguments", (base.dim_x, base.dim_z, base.batch))?;
        Ok((py.import("jacoflow._jacoflow")?.getattr("_restore_extended")?, (state,)))
    }
}

/// The inverse of `ExtendedKalmanFilter.__reduce__`.
#[pyfunction(name = "_restore_extended")]
pub fn restore_extended<'py>(py: Python<'py>, state: &Bound<'py, PyDict>) -> Outcome<Bound<'py, ExtendedKalmanFilter>> {
    let (dim_x, dim_z, batch) = entry(state, "arguments")?.extract()?;
    let filter = Bound::new(py, ExtendedKalmanFilter::new(py, dim_x, dim_z, batch, None, None, None)?)?;
    filter.as_super().get().restore(state)?;
    Ok(filter)
}
