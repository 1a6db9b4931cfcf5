//! `jacoflow.scenes.TargetScene`: colour scenes of targets that look alike, with exact boxes.

use super::{arrays, options::Integer, options::named, scenes::hash};
use crate::errors::Outcome;
use crate::interrupt::interruptible;
use crate::keywords::getters;
use jacoflow::error::Error;
use jacoflow::parallel::Threads;
use jacoflow::synth::targets::{SCENES, TargetScene as CoreScene, TargetSceneOptions};
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict, PyTuple};

/// Most indices in a list of targets.
const MAX_LISTED: usize = 1 << 16;

/// A colour scene of people or cars that look alike, cross and hide each other before a moving camera, with
/// exact boxes.
///
/// `name` is one of `scenes.target_scenes()`. `random_state` chooses the recording: world, texture, gait,
/// shake and noise. `scale` multiplies all lengths; at 1 a frame has 720 x 480 px. `noise` is the standard
/// deviation of the white noise of each channel, grey levels. `frames` is their number, by default that of
/// the scene; zoom and sizes reach their last value in the last frame. `colour_cast` r, 0 to 1, grows to the
/// last frame: red is multiplied by 1 - r, blue by 1 + r / 2. ValueError for an unknown name or an unusable
/// option.
#[pyclass(module = "jacoflow.scenes", frozen)]
pub struct TargetScene {
    core: CoreScene,
}

impl TargetScene {
    /// An index of a frame, refused by name where there is none.
    fn index(&self, t: Integer) -> Outcome<usize> {
        let count = self.core.frame_count();
        let expected = || Error::argument("t", format!("a frame from 0 to {}", count - 1), t);
        Ok(usize::try_from(t.0).ok().filter(|&t| t < count).ok_or_else(expected)?)
    }

    /// Which targets are drawn; all without a list.
    fn drawn(&self, targets: Option<Bound<'_, PyAny>>) -> Outcome<Vec<bool>> {
        let count = self.core.target_count();
        let Some(targets) = targets else { return Ok(vec![true; count]) };
        let mut drawn = vec![false; count];
        let length = targets.len()?;
        if length > MAX_LISTED {
            return Err(Error::argument("targets", format!("indices, at most {MAX_LISTED}"), length).into());
        }
        for target in targets.try_iter()? {
            let target: Integer = target?.extract()?;
            let expected = || Error::argument("targets", format!("indices from 0 to {}", count - 1), target);
            *usize::try_from(target.0).ok().and_then(|k| drawn.get_mut(k)).ok_or_else(expected)? = true;
        }
        Ok(drawn)
    }
}

getters! {
    TargetScene;
    /// Name of the scene (no unit).
    name(this) -> &'static str = this.core.name();
    /// Size (width, height) of the frames, px.
    size(this) -> (usize, usize) = this.core.size();
    /// Number of targets K (no unit).
    n_targets(this) -> usize = this.core.target_count();
    /// Indices of the targets from the farthest to the nearest, which hides the others (no unit).
    drawing_order(this, slf) -> Outcome<Bound<'py, PyTuple>> = Ok(PyTuple::new(slf.py(), this.core.drawing_order())?);
}

#[pymethods]
impl TargetScene {
    #[new]
    #[pyo3(signature = (name, *, random_state=0, scale=0.5, noise=2.5, frames=None, colour_cast=0.0))]
    fn new(
        py: Python<'_>,
        #[pyo3(from_py_with = named::name)] name: &str,
        #[pyo3(from_py_with = named::random_state)] random_state: u64,
        #[pyo3(from_py_with = named::scale)] scale: f64,
        #[pyo3(from_py_with = named::noise)] noise: f64,
        #[pyo3(from_py_with = named::frames)] frames: Option<Integer>,
        #[pyo3(from_py_with = named::colour_cast)] colour_cast: f64,
    ) -> Outcome<Self> {
        let count = |count: Integer| {
            usize::try_from(count.0).map_err(|_| Error::argument("frames", "a positive integer", count))
        };
        let options =
            TargetSceneOptions { random_state, scale, noise, frames: frames.map(count).transpose()?, colour_cast };
        let threads = Threads::new(None)?;
        let core = interruptible(py, || threads.install(|| CoreScene::new(name, options)))?;
        Ok(Self { core })
    }

    /// Number of frames T (no unit).
    fn __len__(&self) -> usize {
        self.core.frame_count()
    }

    /// Frame `t`: uint8 array (H, W, 3), red, green and blue.
    ///
    /// With `targets`, indices, only those are drawn; world, post and noise are the same, so that the
    /// difference shows the pixels of the others.
    #[pyo3(signature = (t, *, targets=None))]
    fn frame<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = named::t)] t: Integer,
        targets: Option<Bound<'py, PyAny>>,
    ) -> Outcome<Bound<'py, PyAny>> {
        let (t, drawn, threads) = (self.index(t)?, self.drawn(targets)?, Threads::new(None)?);
        let frame = interruptible(py, || Ok(threads.install(|| self.core.frame_with(t, |target| drawn[target]))))?;
        let (width, height) = frame.size();
        arrays::owned(py, &[height, width, 3], frame.into_data().into_flattened())
    }

    /// All frames: uint8 array (T, H, W, 3), red, green and blue.
    fn frames<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        let ((width, height), count) = (self.core.size(), self.core.frame_count());
        let mut data: Vec<u8> = Vec::new();
        let room = count.checked_mul(3 * width * height);
        if room.is_none_or(|samples| data.try_reserve_exact(samples).is_err()) {
            let message = format!("frames: no memory for {count} frames of {width} x {height} in colour");
            return Err(PyMemoryError::new_err(message).into());
        }
        let threads = Threads::new(None)?;
        for t in 0..count {
            let frame = interruptible(py, || Ok(threads.install(|| self.core.frame(t))))?;
            data.extend_from_slice(frame.data().as_flattened());
        }
        arrays::owned(py, &[count, height, width, 3], data)
    }

    /// Exact boxes of all frames and targets: float64 array (T, K, 4), left, top, width, height in px,
    /// whether the target is seen or not.
    ///
    /// Pixel centres lie at integers; the centre is left + width / 2, top + height / 2. Arms, legs and a car
    /// on a slope reach a little over it.
    fn boxes<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        let (frames, targets) = (self.core.frame_count(), self.core.target_count());
        let boxes = (0..frames).flat_map(|t| (0..targets).map(move |k| self.core.target_box(t, k)));
        let values = boxes.flat_map(|b| [b.x, b.y, b.width, b.height]).collect();
        arrays::owned::<f64>(py, &[frames, targets, 4], values)
    }

    /// Motion of the still world from each frame to the next: float64 array (T - 1, 2, 3).
    ///
    /// What is at (x, y) px in frame t is at `motion[t] @ (x, y, 1)` px in frame t + 1.
    fn camera_motion<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        let steps = self.core.frame_count() - 1;
        let values = (0..steps).flat_map(|t| self.core.camera_motion(t)).flatten().collect();
        arrays::owned::<f64>(py, &[steps, 2, 3], values)
    }

    /// The same name and options, so the same pictures.
    fn __eq__(&self, other: &Self) -> bool {
        (self.core.name(), self.core.options()) == (other.core.name(), other.core.options())
    }

    fn __hash__(&self) -> u64 {
        let options = self.core.options();
        hash(&(self.core.name(), options.random_state, options.scale.to_bits(), options.frames))
    }

    fn __repr__(&self) -> String {
        let TargetSceneOptions { random_state, scale, .. } = self.core.options();
        format!("TargetScene({:?}, random_state={random_state}, scale={scale})", self.core.name())
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> Outcome<(Bound<'py, PyTuple>, Bound<'py, PyDict>)> {
        let TargetSceneOptions { random_state, scale, noise, frames, colour_cast } = self.core.options();
        let options = PyDict::new(py);
        options.set_item("random_state", random_state)?;
        options.set_item("scale", scale)?;
        options.set_item("noise", noise)?;
        options.set_item("frames", frames)?;
        options.set_item("colour_cast", colour_cast)?;
        Ok((PyTuple::new(py, [self.core.name()])?, options))
    }
}

/// Names of the scenes of targets, with one line about each: a dictionary.
#[pyfunction(name = "_target_scene_names")]
pub fn target_scene_names(py: Python<'_>) -> Outcome<Bound<'_, PyDict>> {
    Ok(SCENES.iter().map(|kind| (kind.name, kind.summary)).into_py_dict(py)?)
}
