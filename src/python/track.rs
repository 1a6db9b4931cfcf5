//! Trackers for Python: frames in, plain values out; the classes a user meets are in `jacoflow.track`.

use super::arrays::{self, ColourRule};
use super::options::{Integer, count};
use crate::error::{Error, Result};
use crate::track::gradient::{
    CameraMotion, Control, GradientOptions, LocalFlow, LocalFlowOptions, MeanFlow, Mode, MovingTarget, RefineOptions,
    Shape, Start, derivative_kernels, detect_moving_target, local_flow, refine_flow,
};
use crate::track::{GradientTracker, GreyLevels, Tracker};
use crate::types::{Frame, TargetBox, TrackState};
use numpy::{PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{Mutex, PoisonError};

/// The compiled part of `jacoflow.track.GradientTracker`.
#[pyclass(name = "_GradientTracker", module = "jacoflow._jacoflow", frozen)]
pub struct PyGradientTracker(Mutex<Following>);

struct Following {
    tracker: GradientTracker,
    /// Decided by the first frame, unless that is too dark to.
    levels: GreyLevels,
}

/// One of some words.
fn word<T: Copy>(argument: &'static str, given: &str, known: &[(&str, T)]) -> Result<T> {
    known.iter().find(|(name, _)| *name == given).map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<_> = known.iter().map(|(name, _)| format!("{name:?}")).collect();
        Error::argument(argument, names.join(", "), format!("{given:?}"))
    })
}

#[pymethods]
impl PyGradientTracker {
    #[new]
    #[pyo3(signature = (frame, bbox, center, method, fov, control, model, camera, order, window, eps))]
    fn new(
        frame: &Bound<'_, PyAny>,
        bbox: Option<[f64; 4]>,
        center: Option<[f64; 2]>,
        method: &str,
        fov: Option<Integer>,
        control: &str,
        model: &str,
        camera: &str,
        order: Option<Integer>,
        window: Option<Integer>,
        eps: Option<f64>,
    ) -> PyResult<Self> {
        let modes = Mode::ALL.map(|mode| (mode.name(), mode));
        let options = GradientOptions {
            mode: word("method", method, &modes)?,
            fov: fov.map(|fov| count("fov", fov)).transpose()?,
            control: word("control", control, &[("integer", Control::Integer), ("subpixel", Control::Subpixel)])?,
            shape: word("model", model, &[("similarity", Shape::Similarity), ("affine", Shape::Affine)])?,
            camera: word("camera", camera, &[("auto", CameraMotion::Auto), ("none", CameraMotion::None)])?,
            order: order.map(|order| count("order", order)).transpose()?,
            window: window.map(|window| count("window", window)).transpose()?,
            eps,
        };
        let start = match (bbox, center) {
            (Some(_), Some(_)) => return Err(Error::argument("center", "a box or a point, not both", "both").into()),
            (Some([x, y, width, height]), None) => Start::Box(TargetBox { x, y, width, height }),
            (None, Some(at)) => Start::Centre(at),
            (None, None) => Start::Motion,
        };
        let frame_of = arrays::frame("frame", frame, ColourRule::Refuse)?;
        let levels = GreyLevels::decide(&frame_of);
        let tracker = frame.py().detach(|| GradientTracker::new(&levels.convert(&frame_of), start, &options))?;
        Ok(Self(Mutex::new(Following { tracker, levels })))
    }

    /// The target in the next frame, as a dictionary.
    fn update<'py>(&self, frame: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
        let py = frame.py();
        let frame = arrays::frame("frame", frame, ColourRule::Refuse)?;
        let state = py.detach(|| {
            let mut following = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            let levels = following.levels.revised(std::slice::from_ref(&frame));
            let state = following.tracker.update(&levels.convert(&frame))?;
            following.levels = levels;
            Ok::<_, Error>(state)
        })?;
        told(py, &state)
    }

    /// The target at the last frame, as a dictionary.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        told(py, self.0.lock().unwrap_or_else(PoisonError::into_inner).tracker.state())
    }
}

/// Everything a state says, by the names of `jacoflow.track.TrackResult`.
fn told<'py>(py: Python<'py>, state: &TrackState) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    let vectors = [
        ("position", state.position),
        ("velocity", state.velocity),
        ("acceleration", state.acceleration),
        ("scene_velocity", state.scene_velocity),
        ("camera_motion", state.camera_motion),
        ("displacement", state.displacement),
        ("los", state.line_of_sight),
    ];
    for (name, value) in vectors {
        out.set_item(name, arrays::owned::<f64>(py, &[2], value.to_vec())?)?;
    }
    let covariance = state.covariance.iter().flatten().flatten().copied().collect();
    out.set_item("covariance", arrays::owned::<f64>(py, &[2, 3, 3], covariance)?)?;
    let TargetBox { x, y, width, height } = state.bounds;
    out.set_item("box", arrays::owned::<f64>(py, &[4], vec![x, y, width, height])?)?;
    let numbers = [
        ("scale", state.scale),
        ("rotation", state.rotation),
        ("visibility", state.visibility),
        ("innovation", state.innovation),
        ("gain", state.gain),
    ];
    for (name, value) in numbers {
        out.set_item(name, value)?;
    }
    out.set_item("rotation_observable", state.rotation_observable)?;
    out.set_item("reacquired", state.reacquired)?;
    out.set_item("status", state.status.name())?;
    out.set_item("reason", state.reason)?;
    out.set_item("n_flow", state.flow_count)?;
    out.set_item("frame", state.frame)?;
    Ok(out)
}

/// What moves of a field (H, W, 2), of `jacoflow.track.mean_flow`: velocity, centroid and how many pixels.
#[pyfunction(name = "_mean_flow")]
pub fn mean_flow(
    flow: PyReadonlyArray3<'_, f64>,
    accepted: PyReadonlyArray2<'_, bool>,
    eps: f64,
) -> PyResult<([f64; 2], [f64; 2], usize)> {
    if eps.is_nan() || eps < 0.0 {
        return Err(Error::argument("eps", "a speed in px/frame, at least 0", eps).into());
    }
    let ([height, width, 2], [rows, columns]) = (flow.shape(), accepted.shape()) else {
        return Err(Error::argument("flow", "an array (H, W, 2)", format!("shape {:?}", flow.shape())).into());
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
    let MeanFlow { velocity, centroid, count } = field.mean(eps);
    Ok((velocity, centroid, count))
}

/// Box and displacement of what moves, of `jacoflow.track.detect_moving_target`.
#[pyfunction(name = "_detect_moving_target")]
#[pyo3(signature = (first, second, center))]
pub fn detect(
    py: Python<'_>,
    first: &Bound<'_, PyAny>,
    second: &Bound<'_, PyAny>,
    center: Option<[f64; 2]>,
) -> PyResult<Option<([f64; 4], [f64; 2])>> {
    let (first, second) = pair(first, second)?;
    let (width, height) = first.size();
    if let Some([x, y]) = center.filter(|at| !at.iter().all(|at| at.is_finite())) {
        let expected = format!("a point (x, y) in the {width} x {height} frames");
        return Err(Error::argument("center", expected, format!("({x}, {y})")).into());
    }
    let found = py.detach(|| detect_moving_target(&first, &second, center));
    Ok(found.map(|MovingTarget { bounds: TargetBox { x, y, width, height }, displacement }| {
        ([x, y, width, height], displacement)
    }))
}

/// Two frames of one size in grey levels.
fn pair(first: &Bound<'_, PyAny>, second: &Bound<'_, PyAny>) -> PyResult<(Frame<f64>, Frame<f64>)> {
    let first = arrays::frame("first", first, ColourRule::Refuse)?;
    let frames = [first, arrays::frame("second", second, ColourRule::Refuse)?];
    let levels = GreyLevels::decide_together(&frames);
    let [first, second] = frames.map(|frame| levels.convert(&frame));
    if first.size() != second.size() {
        let told = |frame: &Frame<f64>| format!("{} x {} px", frame.width(), frame.height());
        let expected = format!("a frame as large as the first, {}", told(&first));
        return Err(Error::argument("second", expected, told(&second)).into());
    }
    Ok((first, second))
}

/// Masks (value, x, y) of `jacoflow.track.derivative_kernels`.
#[pyfunction(name = "_derivative_kernels")]
pub fn kernels(py: Python<'_>, order: Integer) -> PyResult<Vec<Bound<'_, PyAny>>> {
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

/// Flow (H, W, 2) and where it is accepted, of `jacoflow.track.local_flow` and `refine_flow`.
#[pyfunction(name = "_local_flow")]
#[pyo3(signature = (first, second, refine, window, order, cond_max, min_sigma, step_max))]
pub fn flow<'py>(
    first: &Bound<'py, PyAny>,
    second: &Bound<'py, PyAny>,
    refine: bool,
    window: Integer,
    order: Integer,
    cond_max: f64,
    min_sigma: f64,
    step_max: f64,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let py = first.py();
    let (window, order) = (count("window", window)?, count("order", order)?);
    let options = LocalFlowOptions { window, order, cond_max, min_sigma, step_max };
    check(&options)?;
    let (first, second) = pair(first, second)?;
    let LocalFlow { flow, accepted } = py.detach(|| {
        if refine {
            refine_flow(&first, &second, &RefineOptions { local: options, ..RefineOptions::default() })
        } else {
            local_flow(&first, &second, &options)
        }
    });
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
