//! `UnscentedKalmanFilter`.

use super::callback::{Callbacks, entry, lead, lock, read, write};
use super::gaussian::{GaussianFilter, sizes};
use super::sequence::{Record, check_each, filtered, for_each_time, items, noises, smoothed};
use super::sigma_points::MerweScaledSigmaPoints;
use crate::errors::Outcome;
use crate::options::{Function, Integer, named};
use crate::{arrays, keywords::getters};
use jacoflow::error::{Error, shape_text};
use jacoflow::filter::UnscentedFilter as Core;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Mutex;

/// Unscented Kalman filter x' = f(x) + w, z = h(x) + v (Julier and Uhlmann 1997, van der Merwe 2004).
///
/// `fx(points, dt)` and `hx(points)` are vectorised: they receive every sigma point in one array (2 n + 1,
/// n), or (B, 2 n + 1, n) with `batch=B`, and return (..., n) and (..., m). `dt` is handed to `fx` as it is,
/// in the unit that `fx` expects. `points` is a MerweScaledSigmaPoints. With `augmented=True` the noise is
/// part of the sigma points, `fx(points, noise, dt)` with 4 n + 1 rows each. With `redraw=True` new points
/// are drawn for the measurement; False measures the propagated ones, as filterpy 1 did, which leaves Q out
/// of the innovation covariance.
///
/// For angles: differences `residual_x(a, b)`, `residual_z(a, b)`, weighted means `x_mean(points, weights)`,
/// `z_mean(points, weights)` and the sum `state_add(x, dx)`; see the attributes.
#[pyclass(module = "jacoflow.filters", extends = GaussianFilter, frozen)]
pub struct UnscentedKalmanFilter {
    core: Mutex<Core>,
    fx: Mutex<Py<PyAny>>,
    hx: Mutex<Py<PyAny>>,
    points: MerweScaledSigmaPoints,
    dt: f64,
    augmented: bool,
}

getters! {
    UnscentedKalmanFilter;
    /// The sigma points in use (constants have no unit).
    points_fn(this) -> MerweScaledSigmaPoints = this.points.clone();
    /// Step handed to `fx`, in the unit that it expects.
    dt(this) -> f64 = this.dt;
    /// Whether the noise is part of the sigma points (no unit).
    augmented(this) -> bool = this.augmented;
    /// Whether new points are drawn for the measurement (no unit).
    redraw(this) -> Outcome<bool> = Ok(lock(&this.core)?.redraw);
}

/// The steps to each time, of a sequence or one number for all.
fn steps<'py>(dts: Option<&Bound<'py, PyAny>>, times: usize) -> Outcome<Vec<Option<Bound<'py, PyAny>>>> {
    match dts {
        Some(dt) if dt.try_iter().is_err() => Ok(vec![Some(dt.clone()); times]),
        dts => for_each_time("dts", dts, times),
    }
}

/// A step, one number.
fn step(name: &'static str, value: &Bound<'_, PyAny>) -> Outcome<f64> {
    let (shape, values) = arrays::doubles(name, value)?;
    match (shape.is_empty(), values.as_slice()) {
        (true, [dt]) => Ok(*dt),
        _ => Err(Error::argument(name, "a number", format!("shape {}", shape_text(&shape))).into()),
    }
}

#[pymethods]
impl UnscentedKalmanFilter {
    #[new]
    #[pyo3(signature = (
        dim_x, dim_z, dt, hx, fx, points, *, x_mean=None, z_mean=None, residual_x=None, residual_z=None,
        state_add=None, batch=None, augmented=false, redraw=true
    ))]
    fn new(
        py: Python<'_>,
        #[pyo3(from_py_with = named::dim_x)] dim_x: Integer,
        #[pyo3(from_py_with = named::dim_z)] dim_z: Integer,
        dt: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = named::hx)] hx: Function,
        #[pyo3(from_py_with = named::fx)] fx: Function,
        #[pyo3(from_py_with = named::points)] points: MerweScaledSigmaPoints,
        x_mean: Option<Py<PyAny>>,
        z_mean: Option<Py<PyAny>>,
        residual_x: Option<Py<PyAny>>,
        residual_z: Option<Py<PyAny>>,
        state_add: Option<Py<PyAny>>,
        #[pyo3(from_py_with = named::batch)] batch: Option<Integer>,
        #[pyo3(from_py_with = named::augmented)] augmented: bool,
        #[pyo3(from_py_with = named::redraw)] redraw: bool,
    ) -> Outcome<PyClassInitializer<Self>> {
        let (dim_x, dim_z, batch) = sizes(dim_x, dim_z, batch)?;
        let dt = step("dt", dt)?;
        let mut core = Core::new(batch.unwrap_or(1), dim_x, dim_z, points.points)?;
        if points.n != dim_x {
            let expected = format!("sigma points of dim_x = {dim_x} dimensions");
            return Err(Error::argument("points", expected, format!("{} dimensions", points.n)).into());
        }
        core.redraw = redraw;
        let functions = [residual_x, residual_z, state_add, x_mean, z_mean];
        let base = GaussianFilter::new(py, &core.state, batch, functions)?;
        Ok(PyClassInitializer::from(base).add_subclass(Self {
            core: Mutex::new(core),
            fx: Mutex::new(fx.0),
            hx: Mutex::new(hx.0),
            points,
            dt,
            augmented,
        }))
    }

    /// Transition function (points, dt) -> points, on arrays (..., n) in the state's units.
    #[getter]
    fn fx(&self, py: Python<'_>) -> Py<PyAny> {
        read(py, &self.fx)
    }
    #[setter]
    fn set_fx(&self, #[pyo3(from_py_with = named::fx)] value: Function) {
        write(&self.fx, value.0);
    }
    /// Measurement function points (..., n) -> (..., m), from state to measurement units.
    #[getter]
    fn hx(&self, py: Python<'_>) -> Py<PyAny> {
        read(py, &self.hx)
    }
    #[setter]
    fn set_hx(&self, #[pyo3(from_py_with = named::hx)] value: Function) {
        write(&self.hx, value.0);
    }

    /// Weighted mean `x_mean(points, weights)` of states, arrays (2 n + 1, n) or (B, 2 n + 1, n) and (2 n
    /// + 1,) -> (n,) or (B, n), in the state's units; weights sum to 1 and may be negative. None: the
    /// arithmetic mean.
    #[getter]
    fn x_mean(slf: &Bound<'_, Self>) -> Py<PyAny> {
        slf.as_super().get().function(slf.py(), 3)
    }
    #[setter]
    fn set_x_mean(slf: &Bound<'_, Self>, value: Option<Py<PyAny>>) -> Outcome<()> {
        slf.as_super().get().set_function(slf.py(), 3, value)
    }
    /// As `x_mean`, of measurements: (..., 2 n + 1, m) -> (..., m), in the measurement's units.
    #[getter]
    fn z_mean(slf: &Bound<'_, Self>) -> Py<PyAny> {
        slf.as_super().get().function(slf.py(), 4)
    }
    #[setter]
    fn set_z_mean(slf: &Bound<'_, Self>, value: Option<Py<PyAny>>) -> Outcome<()> {
        slf.as_super().get().set_function(slf.py(), 4, value)
    }

    /// Propagates mean and covariance through `fx` by `dt` (default: that of the constructor, same unit);
    /// keywords are handed to `fx`.
    ///
    /// Exceptions of the functions leave x and P (n,), (n, n) as they were. NumericalError when every state
    /// outgrows the range of numbers.
    #[pyo3(signature = (dt=None, fx=None, **fx_args))]
    fn predict(
        slf: &Bound<'_, Self>,
        dt: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = named::fx)] fx: Option<Function>,
        fx_args: Option<Py<PyDict>>,
    ) -> Outcome<()> {
        let (py, base, this) = (slf.py(), slf.as_super().get(), slf.get());
        let mut core = lock(&this.core)?;
        base.give(py, &mut core.state, None, None)?;
        let dt = dt.map_or(Ok(this.dt), |dt| step("dt", dt))?;
        let (fx, batch, n) = (fx.map_or_else(|| this.fx(py), |fx| fx.0), base.batch, base.dim_x);
        let callbacks = Callbacks::default();
        let (work, augmented, size) = (&mut *core, this.augmented, batch.unwrap_or(1));
        let mut manifold = base.manifold(py, &callbacks);
        let result = py.detach(|| {
            let shape = |values: &[f64]| lead(batch, &[values.len() / (size * n), n]);
            if augmented {
                work.predict_augmented_on(&mut manifold, |points, noise, out| {
                    let shape = shape(points);
                    callbacks.call("fx", &[(&shape, points), (&shape, noise)], &shape, out, |py, inputs| {
                        Ok(fx.bind(py).call((&inputs[0], &inputs[1], dt), fx_args.as_ref().map(|d| d.bind(py)))?)
                    })
                })
            } else {
                work.predict_on(&mut manifold, |points, out| {
                    let shape = shape(points);
                    callbacks.call("fx", &[(&shape, points)], &shape, out, |py, inputs| {
                        Ok(fx.bind(py).call((&inputs[0], dt), fx_args.as_ref().map(|d| d.bind(py)))?)
                    })
                })
            }
        });
        drop(manifold);
        callbacks.finish(result)?;
        base.take(py, &core.state)
    }

    /// Takes in the measurement `z` (m,) or (B, m), in the measurement's units: the components that are
    /// neither NaN nor masked. None means that all are missing.
    ///
    /// `R` and `hx` replace the attributes for this step, keywords are handed to `hx`. Exceptions of the
    /// functions leave x and P as they were.
    #[pyo3(signature = (z, R=None, hx=None, **hx_args))]
    fn update(
        slf: &Bound<'_, Self>,
        z: &Bound<'_, PyAny>,
        R: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = named::hx)] hx: Option<Function>,
        hx_args: Option<Py<PyDict>>,
    ) -> Outcome<()> {
        let (py, base, this) = (slf.py(), slf.as_super().get(), slf.get());
        let z = base.measurement(z)?;
        let mut core = lock(&this.core)?;
        base.give(py, &mut core.state, None, R)?;
        let (hx, batch, n, m) = (hx.map_or_else(|| this.hx(py), |hx| hx.0), base.batch, base.dim_x, base.dim_z);
        let callbacks = Callbacks::default();
        let (work, size) = (&mut *core, batch.unwrap_or(1));
        let mut manifold = base.manifold(py, &callbacks);
        let result = py.detach(|| {
            work.update_on(&mut manifold, &z, |points, out| {
                let rows = points.len() / (size * n);
                let (shape_in, shape_out) = (lead(batch, &[rows, n]), lead(batch, &[rows, m]));
                callbacks.call("hx", &[(&shape_in, points)], &shape_out, out, |py, inputs| {
                    Ok(hx.bind(py).call((&inputs[0],), hx_args.as_ref().map(|d| d.bind(py)))?)
                })
            })
        });
        drop(manifold);
        callbacks.finish(result)?;
        base.take(py, &core.state)
    }

    /// Filters the measurements `zs` of T times, each as `update` takes it, from the present state on.
    ///
    /// Returns means (T, n) and covariances (T, n, n), in the state's units, with the batch's axis after T.
    /// `Rs`, a sequence of T items, replaces R where an item is not None; `dts`, a number or a sequence,
    /// is the step to each time.
    #[pyo3(signature = (zs, Rs=None, dts=None))]
    fn batch_filter<'py>(
        slf: &Bound<'py, Self>,
        zs: &Bound<'py, PyAny>,
        Rs: Option<&Bound<'py, PyAny>>,
        dts: Option<&Bound<'py, PyAny>>,
    ) -> Outcome<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, base, zs) = (slf.py(), slf.as_super().get(), items("zs", zs)?);
        let (Rs, mut record) = (for_each_time("Rs", Rs, zs.len())?, Record::default());
        let dts = steps(dts, zs.len())?;
        check_each(&zs, |z| base.measurement_of("zs", z))?;
        check_each(Rs.iter().flatten(), |R| base.noise("Rs", 3, R))?;
        check_each(dts.iter().flatten(), |dt| step("dts", dt))?;
        for ((z, R), dt) in zs.iter().zip(&Rs).zip(&dts) {
            py.check_signals()?;
            Self::predict(slf, dt.as_ref(), None, None)?;
            Self::update(slf, z, R.as_ref(), None, None)?;
            record.push(py, base)?;
        }
        let [x, P] = record.arrays(py, base)?;
        Ok((x, P))
    }

    /// Smooths filtered means `Xs` (T, n) and covariances `Ps` (T, n, n) of T times, in the state's units,
    /// with the batch's axis after T (Sarkka 2008).
    ///
    /// Returns smoothed means (T, n), covariances and gains (T, n, n); gain k is from time k + 1 to k.
    /// `Qs`, a sequence of T items, and `dts`, a number or a sequence, are of the step to their time, as
    /// in `batch_filter` (filterpy takes dts[k] for the step from k). NaN where a state cannot be
    /// smoothed.
    #[pyo3(signature = (Xs, Ps, Qs=None, dts=None))]
    fn rts_smoother<'py>(
        slf: &Bound<'py, Self>,
        Xs: &Bound<'py, PyAny>,
        Ps: &Bound<'py, PyAny>,
        Qs: Option<&Bound<'py, PyAny>>,
        dts: Option<&Bound<'py, PyAny>>,
    ) -> Outcome<(Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, base, this) = (slf.py(), slf.as_super().get(), slf.get());
        let (times, Xs, Ps) = filtered(base, Xs, Ps)?;
        let Qs = noises(base, Qs, times)?;
        let dts = steps(dts, times)?
            .iter()
            .map(|dt| dt.as_ref().map_or(Ok(this.dt), |dt| step("dts", dt)))
            .collect::<Outcome<Vec<f64>>>()?;
        let (fx, batch, n) = (this.fx(py), base.batch, base.dim_x);
        let mut core = lock(&this.core)?;
        base.give(py, &mut core.state, None, None)?;
        let (callbacks, work) = (Callbacks::default(), &*core);
        let mut manifold = base.manifold(py, &callbacks);
        let given = (&Xs[..], &Ps[..]);
        let shape = |points: &[f64]| lead(batch, &[points.len() / (batch.unwrap_or(1) * n), n]);
        let result = py.detach(|| {
            if this.augmented {
                work.rts_smoother_augmented(&mut manifold, given, Qs.as_deref(), |k, points, noise, out| {
                    let shape = shape(points);
                    callbacks.call("fx", &[(&shape, points), (&shape, noise)], &shape, out, |py, inputs| {
                        Ok(fx.bind(py).call1((&inputs[0], &inputs[1], dts[k]))?)
                    })
                })
            } else {
                work.rts_smoother(&mut manifold, given, Qs.as_deref(), |k, points, out| {
                    let shape = shape(points);
                    callbacks.call("fx", &[(&shape, points)], &shape, out, |py, inputs| {
                        Ok(fx.bind(py).call1((&inputs[0], dts[k]))?)
                    })
                })
            }
        });
        drop(manifold);
        let [x, P, K, _] = smoothed(py, base, times, callbacks.finish(result)?)?;
        Ok((x, P, K))
    }

    fn __repr__(slf: &Bound<'_, Self>) -> String {
        let (base, this) = (slf.as_super().get(), slf.get());
        let augmented = if this.augmented { "True" } else { "False" };
        format!("UnscentedKalmanFilter({}, dt={}, augmented={augmented})", base.describe(), this.dt)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Outcome<(Bound<'py, PyAny>, (Bound<'py, PyDict>,))> {
        let (py, base, this) = (slf.py(), slf.as_super().get(), slf.get());
        let core = lock(&this.core)?;
        let state = base.save(py)?;
        let arguments = (base.dim_x, base.dim_z, this.dt, this.hx(py), this.fx(py), this.points.clone());
        state.set_item("arguments", arguments)?;
        state.set_item("options", (base.batch, this.augmented, core.redraw))?;
        state.set_item("sigmas", arrays::owned(py, &[core.sigmas.len()], core.sigmas.clone())?)?;
        Ok((py.import("jacoflow._jacoflow")?.getattr("_restore_unscented")?, (state,)))
    }
}

/// The inverse of `UnscentedKalmanFilter.__reduce__`.
#[pyfunction(name = "_restore_unscented")]
pub fn restore_unscented<'py>(
    py: Python<'py>,
    state: &Bound<'py, PyDict>,
) -> Outcome<Bound<'py, UnscentedKalmanFilter>> {
    let (dim_x, dim_z, dt, hx, fx, points): (_, _, Bound<'py, PyAny>, _, _, _) =
        entry(state, "arguments")?.extract()?;
    let (batch, augmented, redraw) = entry(state, "options")?.extract()?;
    let made = UnscentedKalmanFilter::new(
        py, dim_x, dim_z, &dt, hx, fx, points, None, None, None, None, None, batch, augmented, redraw,
    )?;
    let filter = Bound::new(py, made)?;
    filter.as_super().get().restore(state)?;
    lock(&filter.get().core)?.sigmas = arrays::doubles("state", &entry(state, "sigmas")?)?.1;
    Ok(filter)
}
