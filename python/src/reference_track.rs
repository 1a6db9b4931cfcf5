//! The paper's loop of the gradient tracker for Python (feature `reference`); what a user meets is in
//! `jacoflow.reference`.

use super::arrays;
use super::options::{Integer, count};
use super::track::{PyGradientTracker, begin, camera_of, pair, word};
use crate::errors::Outcome;
use crate::interrupt::interruptible;
use jacoflow::error::{Error, Result, shape_text};
use jacoflow::track::GradientTracker;
use jacoflow::track::gradient::reference::{
    Control, LocalFlow, LocalFlowOptions, MeanFlow, Method, ReferenceOptions, derivative_kernels, local_flow,
};
use jacoflow::types::Frame;
use numpy::{PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// The compiled part of `jacoflow.reference.ReferenceTracker`.
#[pyfunction(name = "_reference_tracker")]
#[pyo3(signature = (frame, bbox, center, method, search_window, control, camera, order, window, min_speed))]
pub fn tracker(
    frame: &Bound<'_, PyAny>,
    bbox: Option<[f64; 4]>,
    center: Option<[f64; 2]>,
    method: &str,
    search_window: Option<Integer>,
    control: &str,
    camera: &str,
    order: Option<Integer>,
    window: Option<Integer>,
    min_speed: Option<f64>,
) -> Outcome<PyGradientTracker> {
    let options = ReferenceOptions {
        method: word("method", method, &[("local", Method::Local), ("paper", Method::Paper)])?,
        search_window: search_window.map(|side| count("search_window", side.saturated())).transpose()?,
        control: word("control", control, &[("integer", Control::Integer), ("subpixel", Control::Subpixel)])?,
        camera: camera_of(camera)?,
        order: order.map(|order| count("order", order)).transpose()?,
        window: window.map(|window| count("window", window)).transpose()?,
        min_speed,
    };
    begin(frame, (bbox, center), |frame, start| GradientTracker::reference(frame, start, &options))
}

#[pymethods]
impl PyGradientTracker {
    /// Center of the window that is searched, px, and how many pixels moved in it; None before it starts.
    fn search_window(&self, py: Python<'_>) -> Outcome<Option<([f64; 2], usize)>> {
        let window = self.0.with(py, |following| following.tracker.search_window())?;
        Ok(window.map(|window| (window.center, window.flow_count)))
    }
}

/// What moves of a field (H, W, 2), of `jacoflow.reference.mean_flow`: velocity, centroid and count.
#[pyfunction(name = "_mean_flow")]
pub fn mean_flow(
    flow: PyReadonlyArray3<'_, f64>,
    accepted: PyReadonlyArray2<'_, bool>,
    min_speed: f64,
) -> Outcome<([f64; 2], [f64; 2], usize)> {
    if min_speed.is_nan() || min_speed < 0.0 {
        return Err(Error::argument("min_speed", "a speed in px/frame, at least 0", min_speed).into());
    }
    let ([height, width, 2], [rows, columns]) = (flow.shape(), accepted.shape()) else {
        return Err(Error::argument("flow", "an array (H, W, 2)", format!("shape {}", shape_text(flow.shape()))).into());
    };
    if (height, width) != (rows, columns) {
        let expected = format!("an array ({height}, {width}) like the flow");
        return Err(Error::argument("valid", expected, format!("({rows}, {columns})")).into());
    }
    let (flow, accepted) = (flow.as_array(), accepted.as_array());
    let field = LocalFlow {
        flow: Frame::from_fn(*width, *height, |x, y| [flow[[y, x, 0]], flow[[y, x, 1]]]),
        accepted: Frame::from_fn(*width, *height, |x, y| accepted[[y, x]]),
    };
    let MeanFlow { velocity, centroid, count } = field.mean(min_speed);
    Ok((velocity, centroid, count))
}

/// Masks (value, x, y) of `jacoflow.reference.derivative_kernels`.
#[pyfunction(name = "_derivative_kernels")]
pub fn kernels(py: Python<'_>, order: Integer) -> Outcome<Vec<Bound<'_, PyAny>>> {
    let order = count("order", order)?;
    if !(1..=4).contains(&order) {
        return Err(Error::argument("order", "1, 2, 3 or 4", order).into());
    }
    let kernels = derivative_kernels(order);
    [kernels.value, kernels.x, kernels.y]
        .into_iter()
        .map(|mask| Ok(arrays::owned::<f64>(py, &[5, 5], mask.as_flattened().to_vec())?.into_any()))
        .collect()
}

/// Flow (H, W, 2) and where it is accepted, of `jacoflow.reference.local_flow`.
#[pyfunction(name = "_local_flow")]
#[pyo3(signature = (first, second, window, order, cond_max, min_sigma, step_max))]
pub fn gradient_flow<'py>(
    first: &Bound<'py, PyAny>,
    second: &Bound<'py, PyAny>,
    window: Integer,
    order: Integer,
    cond_max: f64,
    min_sigma: f64,
    step_max: f64,
) -> Outcome<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let py = first.py();
    let (window, order) = (count("window", window)?, count("order", order)?);
    let options = LocalFlowOptions { window, order, cond_max, min_sigma, step_max };
    check(&options)?;
    let (first, second) = pair(first, second)?;
    let LocalFlow { flow, accepted } = interruptible(py, || Ok(local_flow(&first, &second, &options)))?;
    let (width, height) = flow.size();
    let values = flow.data().iter().flatten().copied().collect();
    let flow = arrays::owned::<f64>(py, &[height, width, 2], values)?.into_any();
    Ok((flow, arrays::owned::<bool>(py, &[height, width], accepted.into_data())?.into_any()))
}

fn check(options: &LocalFlowOptions) -> Result<()> {
    if ![3, 5, 7].contains(&options.window) {
        return Err(Error::argument("window", "3, 5 or 7 px", options.window));
    }
    if !(1..=4).contains(&options.order) {
        return Err(Error::argument("order", "1, 2, 3 or 4", options.order));
    }
    for (name, value) in
        [("cond_max", options.cond_max), ("min_sigma", options.min_sigma), ("step_max", options.step_max)]
    {
        if value.is_nan() || value < 0.0 {
            return Err(Error::argument(name, "a number that is not negative", value));
        }
    }
    Ok(())
}
