//! `ExtendedKalmanFilter`.

use super::{callback::Callbacks, callback::entry, callback::lead, callback::lock, gaussian::GaussianFilter};
use crate::errors::Outcome;
use jacoflow::filter::ExtendedFilter as Core;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Mutex;

/// Extended Kalman filter x' = f(x) + w, z = h(x) + v, linearised at the mean.
///
/// `dim_x` = n and `dim_z` = m dimensions; `batch` = B runs B independent filters, every array then having a
/// leading axis (B, ...). Functions are vectorised over leading axes: `fx` and `Hx` map (..., n) to (..., n)
/// and (..., m); `FJacobian` and `HJacobian` map the means (n,) or (B, n) to (n, n) or (B, n, n) and (m, n)
/// or (B, m, n). Without a Jacobian central differences are taken.
#[pyclass(module = "jacoflow.filters", extends = GaussianFilter, frozen)]
pub struct ExtendedKalmanFilter {
    core: Mutex<Core>,
}

/// Calls `function` on rows of states that have `rows` rows for each filter (1: the means themselves, without
/// that axis).
fn on_rows(
    callbacks: &Callbacks,
    name: &'static str,
    function: &Py<PyAny>,
    batch: Option<usize>,
    (n, width): (usize, usize),
    (points, out): (&[f64], &mut [f64]),
) -> jacoflow::Result<()> {
    let rows = points.len() / (batch.unwrap_or(1) * n);
    let shape = |width: usize| if rows == 1 { lead(batch, &[width]) } else { lead(batch, &[rows, width]) };
    callbacks.call(name, &[(&shape(n), points)], &shape(width), out, |py, inputs| {
        Ok(function.bind(py).call1((&inputs[0],))?)
    })
}

#[pymethods]
impl ExtendedKalmanFilter {
    #[new]
    #[pyo3(signature = (dim_x, dim_z, *, batch=None))]
    fn new(py: Python<'_>, dim_x: usize, dim_z: usize, batch: Option<usize>) -> Outcome<PyClassInitializer<Self>> {
        let core = Core::new(batch.unwrap_or(1), dim_x, dim_z)?;
        let base = GaussianFilter::new(py, &core.state, batch)?;
        Ok(PyClassInitializer::from(base).add_subclass(Self { core: Mutex::new(core) }))
    }

    /// x <- fx(x), P <- F P F^T + Q with F = `FJacobian(x)`, arrays (n,) and (n, n) or with a leading (B,
    /// ...), in the state's units.
    ///
    /// Exceptions of the functions leave x and P as they were.
    #[pyo3(signature = (fx, FJacobian=None))]
    fn predict(slf: &Bound<'_, Self>, fx: Py<PyAny>, FJacobian: Option<Py<PyAny>>) -> Outcome<()> {
        let (py, base) = (slf.py(), slf.as_super().get());
        let mut core = lock(&slf.get().core)?;
        base.give(py, &mut core.state, None, None)?;
        let (batch, n, callbacks, work) = (base.batch, base.dim_x, Callbacks::default(), &mut *core);
        let result = py.detach(|| {
            let step = |points: &[f64], out: &mut [f64]| on_rows(&callbacks, "fx", &fx, batch, (n, n), (points, out));
            match &FJacobian {
                None => work.predict_by_differences(step),
                Some(jacobian) => work.predict(step, |means, out| {
                    let (shape_in, shape_out) = (lead(batch, &[n]), lead(batch, &[n, n]));
                    callbacks.call("FJacobian", &[(&shape_in, means)], &shape_out, out, |py, inputs| {
                        Ok(jacobian.bind(py).call1((&inputs[0],))?)
                    })
                }),
            }
        });
        callbacks.finish(result)?;
        base.take(py, &core.state)
    }

    /// Takes in the measurement `z` (m,) or (B, m), in the measurement's units; None and NaN mean a missing
    /// one.
    ///
    /// `HJacobian` None takes central differences of `Hx`. `R` replaces the attribute for this step.
    /// Exceptions of the functions leave x and P as they were.
    #[pyo3(signature = (z, HJacobian, Hx, R=None))]
    fn update(
        slf: &Bound<'_, Self>,
        z: &Bound<'_, PyAny>,
        HJacobian: Option<Py<PyAny>>,
        Hx: Py<PyAny>,
        R: Option<&Bound<'_, PyAny>>,
    ) -> Outcome<()> {
        let (py, base) = (slf.py(), slf.as_super().get());
        let z = base.measurement(z)?;
        let mut core = lock(&slf.get().core)?;
        base.give(py, &mut core.state, None, R)?;
        let (batch, n, m, callbacks, work) = (base.batch, base.dim_x, base.dim_z, Callbacks::default(), &mut *core);
        let result = py.detach(|| {
            let measure =
                |points: &[f64], out: &mut [f64]| on_rows(&callbacks, "Hx", &Hx, batch, (n, m), (points, out));
            match &HJacobian {
                None => work.update_by_differences(&z, measure),
                Some(jacobian) => work.update(&z, measure, |means, out| {
                    let (shape_in, shape_out) = (lead(batch, &[n]), lead(batch, &[m, n]));
                    callbacks.call("HJacobian", &[(&shape_in, means)], &shape_out, out, |py, inputs| {
                        Ok(jacobian.bind(py).call1((&inputs[0],))?)
                    })
                }),
            }
        });
        callbacks.finish(result)?;
        base.take(py, &core.state)
    }

    fn __repr__(slf: &Bound<'_, Self>) -> String {
        let base = slf.as_super().get();
        let batch = base.batch.map_or("None".to_owned(), |b| b.to_string());
        format!("ExtendedKalmanFilter(dim_x={}, dim_z={}, batch={batch})", base.dim_x, base.dim_z)
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
    let filter = Bound::new(py, ExtendedKalmanFilter::new(py, dim_x, dim_z, batch)?)?;
    filter.as_super().get().restore(state)?;
    Ok(filter)
}
