//! `UnscentedKalmanFilter`.

use super::callback::{Callbacks, entry, lead, lock, read, write};
use super::gaussian::GaussianFilter;
use super::sigma_points::MerweScaledSigmaPoints;
use crate::errors::Outcome;
use crate::{arrays, keywords::getters};
use jacoflow::error::Error;
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

#[pymethods]
impl UnscentedKalmanFilter {
    #[new]
    #[pyo3(signature = (dim_x, dim_z, dt, hx, fx, points, *, batch=None, augmented=false, redraw=true))]
    fn new(
        py: Python<'_>,
        dim_x: usize,
        dim_z: usize,
        dt: f64,
        hx: Py<PyAny>,
        fx: Py<PyAny>,
        points: MerweScaledSigmaPoints,
        batch: Option<usize>,
        augmented: bool,
        redraw: bool,
    ) -> Outcome<PyClassInitializer<Self>> {
        if points.n != dim_x {
            let expected = format!("sigma points of dim_x = {dim_x} dimensions");
            return Err(Error::argument("points", expected, format!("{} dimensions", points.n)).into());
        }
        let mut core = Core::new(batch.unwrap_or(1), dim_x, dim_z, points.points)?;
        core.redraw = redraw;
        let base = GaussianFilter::new(py, &core.state, batch)?;
        Ok(PyClassInitializer::from(base).add_subclass(Self {
            core: Mutex::new(core),
            fx: Mutex::new(fx),
            hx: Mutex::new(hx),
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
    fn set_fx(&self, value: Py<PyAny>) {
        write(&self.fx, value);
    }
    /// Measurement function points (..., n) -> (..., m), from state to measurement units.
    #[getter]
    fn hx(&self, py: Python<'_>) -> Py<PyAny> {
        read(py, &self.hx)
    }
    #[setter]
    fn set_hx(&self, value: Py<PyAny>) {
        write(&self.hx, value);
    }

    /// Propagates mean and covariance through `fx` by `dt` (default: that of the constructor, same unit);
    /// keywords are handed to `fx`.
    ///
    /// Exceptions of `fx` leave x and P (n,), (n, n) as they were. NumericalError when P has no
    /// positive-definite repair.
    #[pyo3(signature = (dt=None, fx=None, **fx_args))]
    fn predict(
        slf: &Bound<'_, Self>,
        dt: Option<f64>,
        fx: Option<Py<PyAny>>,
        fx_args: Option<Py<PyDict>>,
    ) -> Outcome<()> {
        let (py, base, this) = (slf.py(), slf.as_super().get(), slf.get());
        let mut core = lock(&this.core)?;
        base.give(py, &mut core.state, None, None)?;
        let (dt, fx, batch, n) = (dt.unwrap_or(this.dt), fx.unwrap_or_else(|| this.fx(py)), base.batch, base.dim_x);
        let callbacks = Callbacks::default();
        let (work, augmented, size) = (&mut *core, this.augmented, batch.unwrap_or(1));
        let result = py.detach(|| {
            let shape = |values: &[f64]| lead(batch, &[values.len() / (size * n), n]);
            if augmented {
                work.predict_augmented(|points, noise, out| {
                    let shape = shape(points);
                    callbacks.call("fx", &[(&shape, points), (&shape, noise)], &shape, out, |py, inputs| {
                        Ok(fx.bind(py).call((&inputs[0], &inputs[1], dt), fx_args.as_ref().map(|d| d.bind(py)))?)
                    })
                })
            } else {
                work.predict(|points, out| {
                    let shape = shape(points);
                    callbacks.call("fx", &[(&shape, points)], &shape, out, |py, inputs| {
                        Ok(fx.bind(py).call((&inputs[0], dt), fx_args.as_ref().map(|d| d.bind(py)))?)
                    })
                })
            }
        });
        callbacks.finish(result)?;
        base.take(py, &core.state)
    }

    /// Takes in the measurement `z` (m,) or (B, m), in the measurement's units; None and NaN mean a missing
    /// one.
    ///
    /// `R` and `hx` replace the attributes for this step, keywords are handed to `hx`. Exceptions of `hx`
    /// leave x and P as they were.
    #[pyo3(signature = (z, R=None, hx=None, **hx_args))]
    fn update(
        slf: &Bound<'_, Self>,
        z: &Bound<'_, PyAny>,
        R: Option<&Bound<'_, PyAny>>,
        hx: Option<Py<PyAny>>,
        hx_args: Option<Py<PyDict>>,
    ) -> Outcome<()> {
        let (py, base, this) = (slf.py(), slf.as_super().get(), slf.get());
        let z = base.measurement(z)?;
        let mut core = lock(&this.core)?;
        base.give(py, &mut core.state, None, R)?;
        let (hx, batch, n, m) = (hx.unwrap_or_else(|| this.hx(py)), base.batch, base.dim_x, base.dim_z);
        let callbacks = Callbacks::default();
        let (work, size) = (&mut *core, batch.unwrap_or(1));
        let result = py.detach(|| {
            work.update(&z, |points, out| {
                let rows = points.len() / (size * n);
                let (shape_in, shape_out) = (lead(batch, &[rows, n]), lead(batch, &[rows, m]));
                callbacks.call("hx", &[(&shape_in, points)], &shape_out, out, |py, inputs| {
                    Ok(hx.bind(py).call((&inputs[0],), hx_args.as_ref().map(|d| d.bind(py)))?)
                })
            })
        });
        callbacks.finish(result)?;
        base.take(py, &core.state)
    }

    fn __repr__(slf: &Bound<'_, Self>) -> String {
        let (base, this) = (slf.as_super().get(), slf.get());
        let batch = base.batch.map_or("None".to_owned(), |b| b.to_string());
        let augmented = if this.augmented { "True" } else { "False" };
        format!(
            "UnscentedKalmanFilter(dim_x={}, dim_z={}, dt={}, batch={batch}, augmented={augmented})",
            base.dim_x, base.dim_z, this.dt
        )
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
    let (dim_x, dim_z, dt, hx, fx, points) = entry(state, "arguments")?.extract()?;
    let (batch, augmented, redraw) = entry(state, "options")?.extract()?;
    let made = UnscentedKalmanFilter::new(py, dim_x, dim_z, dt, hx, fx, points, batch, augmented, redraw)?;
    let filter = Bound::new(py, made)?;
    filter.as_super().get().restore(state)?;
    lock(&filter.get().core)?.sigmas = arrays::doubles("state", &entry(state, "sigmas")?)?.1;
    Ok(filter)
}
