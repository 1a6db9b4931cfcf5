//! Trackers for Python: frames in, plain values out; the classes a user meets are in `jacoflow.track`.

use super::arrays::{self, ColourRule};
use crate::errors::Outcome;
use crate::interrupt::{Held, interruptible};
use jacoflow::error::{Error, Result};
use jacoflow::track::gradient::{CameraMotion, GradientOptions, MovingTarget, Shape, Start, detect_moving_target};
use jacoflow::track::{GradientTracker, GreyLevels, Tracker};
use jacoflow::types::{Frame, TargetBox, TrackState};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

/// The compiled part of `jacoflow.track.GradientTracker`.
#[pyclass(name = "_GradientTracker", module = "jacoflow._jacoflow", frozen)]
pub struct PyGradientTracker(pub(super) Held<Following>);

pub(super) struct Following {
    pub(super) tracker: GradientTracker,
    /// Decided by the first frame, unless that is too dark to.
    levels: GreyLevels,
}

/// One of some words.
pub(super) fn word<T: Copy>(argument: &'static str, given: &str, known: &[(&str, T)]) -> Result<T> {
    known.iter().find(|(name, _)| *name == given).map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<_> = known.iter().map(|(name, _)| format!("{name:?}")).collect();
        Error::argument(argument, names.join(", "), format!("{given:?}"))
    })
}

/// Begins to follow by one of the methods.
pub(super) fn begin(
    frame: &Bound<'_, PyAny>,
    (bbox, center): (Option<[f64; 4]>, Option<[f64; 2]>),
    method: impl FnOnce(&Frame<f64>, Start) -> Result<GradientTracker> + Send,
) -> Outcome<PyGradientTracker> {
    let start = match (bbox, center) {
        (Some(_), Some(_)) => return Err(Error::argument("center", "a box or a point, not both", "both").into()),
        (Some([x, y, width, height]), None) => Start::Box(TargetBox { x, y, width, height }),
        (None, Some(at)) => Start::Centre(at),
        (None, None) => Start::Motion,
    };
    let frame_of = arrays::tracked_frame("frame", frame, ColourRule::Refuse, GreyLevels::of_integers())?;
    let levels = GreyLevels::decide(&frame_of);
    let tracker = interruptible(frame.py(), || method(&levels.convert(&frame_of), start))?;
    Ok(PyGradientTracker(Held::new(Following { tracker, levels })))
}

/// What the camera may do.
pub(super) fn camera_of(word_given: &str) -> Result<CameraMotion> {
    word("camera", word_given, &[("auto", CameraMotion::Auto), ("none", CameraMotion::None)])
}

#[pymethods]
impl PyGradientTracker {
    #[new]
    #[pyo3(signature = (frame, bbox, center, model, camera))]
    fn new(
        frame: &Bound<'_, PyAny>,
        bbox: Option<[f64; 4]>,
        center: Option<[f64; 2]>,
        model: &str,
        camera: &str,
    ) -> Outcome<Self> {
        let options = GradientOptions {
            shape: word("model", model, &[("similarity", Shape::Similarity), ("affine", Shape::Affine)])?,
            camera: camera_of(camera)?,
        };
        begin(frame, (bbox, center), |frame, start| GradientTracker::new(frame, start, &options))
    }

    /// The target in the next frame, as a dictionary.
    fn update<'py>(&self, frame: &Bound<'py, PyAny>) -> Outcome<Bound<'py, PyDict>> {
        let py = frame.py();
        let levels = self.0.with(py, |following| following.levels)?;
        let frame = arrays::tracked_frame("frame", frame, ColourRule::Refuse, levels)?;
        let state = self.0.change(py, |following| {
            let levels = following.levels.revised(std::slice::from_ref(&frame));
            let state = following.tracker.update(&levels.convert(&frame))?;
            following.levels = levels;
            Ok::<_, Error>(state)
        })?;
        to_dict(py, &state)
    }

    /// The target at the last frame, as a dictionary.
    fn state<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyDict>> {
        to_dict(py, &self.0.with(py, |following| following.tracker.state().clone())?)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Outcome<(Bound<'py, PyAny>, (Bound<'py, PyBytes>, f64))> {
        let py = slf.py();
        let saved = |following: &mut Following| (following.tracker.to_bytes(), following.levels.float_gain());
        let (bytes, gain) = slf.get().0.with(py, saved)?;
        let restore = py.import("jacoflow._jacoflow")?.getattr("_restore_gradient_tracker")?;
        Ok((restore, (PyBytes::new(py, &bytes), gain)))
    }
}

/// The inverse of `_GradientTracker.__reduce__`.
#[pyfunction(name = "_restore_gradient_tracker")]
pub fn restore_gradient_tracker(py: Python<'_>, state: &[u8], gain: f64) -> Outcome<PyGradientTracker> {
    let tracker = py.detach(|| GradientTracker::from_bytes(state))?;
    Ok(PyGradientTracker(Held::new(Following { tracker, levels: GreyLevels::of_floats(gain) })))
}

/// A state by the names of `jacoflow.track.TrackResult`.
fn to_dict<'py>(py: Python<'py>, state: &TrackState) -> Outcome<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    let vectors = [
        ("position", state.position),
        ("velocity", state.velocity),
        ("acceleration", state.acceleration),
        ("scene_velocity", state.scene_velocity),
        ("camera_motion", state.camera_motion),
        ("displacement", state.displacement),
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
    out.set_item("reason", &*state.reason)?;
    out.set_item("frame", state.frame)?;
    Ok(out)
}

/// Box and displacement of what moves, of `jacoflow.track.detect_moving_target`.
#[pyfunction(name = "_detect_moving_target")]
#[pyo3(signature = (first, second, center))]
pub fn detect(
    py: Python<'_>,
    first: &Bound<'_, PyAny>,
    second: &Bound<'_, PyAny>,
    center: Option<[f64; 2]>,
) -> Outcome<Option<([f64; 4], [f64; 2])>> {
    let (first, second) = pair(first, second)?;
    let (width, height) = first.size();
    if let Some([x, y]) = center.filter(|at| !at.iter().all(|at| at.is_finite())) {
        let expected = format!("a point (x, y) in the {width} x {height} frames");
        return Err(Error::argument("center", expected, format!("({x}, {y})")).into());
    }
    let found = interruptible(py, || Ok(detect_moving_target(&first, &second, center)))?;
    Ok(found.map(|MovingTarget { bounds: TargetBox { x, y, width, height }, displacement }| {
        ([x, y, width, height], displacement)
    }))
}

/// Two frames of one size in grey levels.
pub(super) fn pair(first: &Bound<'_, PyAny>, second: &Bound<'_, PyAny>) -> Outcome<(Frame<f64>, Frame<f64>)> {
    let first = arrays::frame("first", first, ColourRule::Refuse)?;
    let frames = [first, arrays::frame("second", second, ColourRule::Refuse)?];
    let levels = GreyLevels::decide_together(&frames);
    let [first, second] = frames.map(|frame| levels.convert(&frame));
    if first.size() != second.size() {
        let size = |frame: &Frame<f64>| format!("{} x {} px", frame.width(), frame.height());
        let expected = format!("a frame as large as the first, {}", size(&first));
        return Err(Error::argument("second", expected, size(&second)).into());
    }
    Ok((first, second))
}
