//! The stereo tracker for Python: views in, plain values out; the classes a user meets are in
//! `jacoflow.track`.

mod options;

use self::options::Given;
use super::arrays::{self, ColourRule};
use super::stereo::in_levels;
use crate::errors::Outcome;
use crate::interrupt::Held;
use crate::options::named;
use jacoflow::error::Error;
use jacoflow::track::GreyLevels;
use jacoflow::track::stereo::{EdgePoints, Node, Step, StereoCamera, StereoTracker, TrackGraph};
use jacoflow::types::{AnyFrame, Frame};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList};

/// The compiled part of `jacoflow.track.StereoTracker`.
#[pyclass(name = "_StereoTracker", module = "jacoflow._jacoflow", frozen)]
pub struct PyStereoTracker(Held<Tracking>);

struct Tracking {
    tracker: StereoTracker,
    /// Decided by the first views, unless they are too dark to.
    levels: Option<GreyLevels>,
}

impl Tracking {
    /// A step from views, the left one first, in grey levels, `dt` after the last one: views with which no
    /// step can be taken say nothing of the scale of floats.
    fn step<const N: usize>(
        &mut self,
        views: &[AnyFrame; N],
        dt: Option<f64>,
        take: impl FnOnce(&mut StereoTracker, [Frame<f32>; N]) -> jacoflow::error::Result<Step>,
    ) -> jacoflow::error::Result<Step> {
        let levels = match self.levels {
            Some(known) => known.revised(views),
            None => GreyLevels::decide_together(views),
        };
        self.tracker.after(dt.unwrap_or(self.tracker.options().step_time))?;
        let step = take(&mut self.tracker, views.each_ref().map(|view| in_levels(view, levels.gain(view))))?;
        self.levels = Some(levels);
        Ok(step)
    }
}

impl PyStereoTracker {
    /// What floats are taken for so far.
    fn levels(&self, py: Python<'_>) -> Outcome<GreyLevels> {
        Ok(self.0.with(py, |tracking| tracking.levels)?.unwrap_or(GreyLevels::of_integers()))
    }
}

#[pymethods]
impl PyStereoTracker {
    #[new]
    fn new(options: &Bound<'_, PyDict>) -> Outcome<Self> {
        let options = options.extract::<Given>()?.options()?;
        Ok(Self(Held::new(Tracking { tracker: StereoTracker::new(options)?, levels: None })))
    }

    /// The next step from both views, `dt` after the last one, as a dictionary.
    fn update<'py>(
        &self,
        left: &Bound<'py, PyAny>,
        right: &Bound<'py, PyAny>,
        dt: Option<f64>,
    ) -> Outcome<Bound<'py, PyDict>> {
        let py = left.py();
        let levels = self.levels(py)?;
        let views = [
            arrays::tracked_frame("left", left, ColourRule::Luminance, levels)?,
            arrays::tracked_frame("right", right, ColourRule::Luminance, levels)?,
        ];
        let step = self
            .0
            .change(py, |tracking| tracking.step(&views, dt, |tracker, [left, right]| tracker.update(&left, &right)))?;
        step_dict(py, step)
    }

    /// The next step from the left view and its disparities, NaN where there is none, `dt` after the last
    /// one, as a dictionary.
    fn update_disparity<'py>(
        &self,
        left: &Bound<'py, PyAny>,
        disparity: &Bound<'py, PyAny>,
        dt: Option<f64>,
    ) -> Outcome<Bound<'py, PyDict>> {
        let py = left.py();
        let left = arrays::tracked_frame("left", left, ColourRule::Luminance, self.levels(py)?)?;
        let disparity = match arrays::frame_with_gaps("disparity", disparity, ColourRule::Refuse)? {
            map @ (AnyFrame::F32(_) | AnyFrame::F64(_)) => map.to_real::<f32>(),
            other => {
                let message = format!("disparity: expected an array of float32 or float64, got {}", other.dtype());
                return Err(PyTypeError::new_err(message).into());
            }
        };
        if left.size() != disparity.size() {
            let shape = |(width, height): (usize, usize)| format!("({height}, {width})");
            let expected = format!("the left view's shape {}", shape(left.size()));
            return Err(Error::argument("disparity", expected, shape(disparity.size())).into());
        }
        let points = EdgePoints::from_map(&disparity);
        let step = self
            .0
            .change(py, |tracking| tracking.step(&[left], dt, |tracker, [left]| tracker.update_edges(&left, points)))?;
        step_dict(py, step)
    }

    /// How many rows lower the right view shows a point, where that is known.
    fn row_offset(&self, py: Python<'_>) -> Outcome<Option<f64>> {
        self.0.with(py, |tracking| tracking.tracker.row_offset())
    }

    /// Clusters of all steps so far and their arcs.
    fn graph(&self, py: Python<'_>) -> Outcome<PyTrackGraph> {
        Ok(PyTrackGraph(self.0.with(py, |tracking| tracking.tracker.graph().clone())?))
    }

    /// Tracks by id: times (T,), positions (T, 3), velocities (T, 3) and when that was (T,).
    fn tracks<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyDict>> {
        let out = PyDict::new(py);
        for (id, track) in &self.0.with(py, |tracking| tracking.tracker.tracks().clone())? {
            let count = track.times.len();
            let times = track.times.iter().map(|&time| time as i64).collect();
            let flat = |values: &[[f64; 3]]| values.iter().flatten().copied().collect();
            let parts = (
                arrays::owned::<i64>(py, &[count], times)?,
                arrays::owned::<f64>(py, &[count, 3], flat(&track.positions))?,
                arrays::owned::<f64>(py, &[count, 3], flat(&track.velocities))?,
                arrays::owned::<f64>(py, &[count], track.clock.clone())?,
            );
            out.set_item(id, parts)?;
        }
        Ok(out)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Outcome<(Bound<'py, PyAny>, (Bound<'py, PyBytes>, Option<f64>))> {
        let py = slf.py();
        let saved = |this: &mut Tracking| (this.tracker.to_bytes(), this.levels.map(GreyLevels::float_gain));
        let (bytes, gain) = slf.get().0.with(py, saved)?;
        let restore = py.import("jacoflow._jacoflow")?.getattr("_restore_stereo_tracker")?;
        Ok((restore, (PyBytes::new(py, &bytes), gain)))
    }
}

/// Refuses a length or a disparity of `jacoflow.track.StereoCamera` by its name.
#[pyfunction(name = "_check_camera")]
#[pyo3(signature = (focal, baseline, d_infinity))]
pub fn check_camera(focal: f64, baseline: f64, d_infinity: f64) -> Outcome<()> {
    Ok(StereoCamera { focal, baseline, d_infinity }.check()?)
}

/// The inverse of `_StereoTracker.__reduce__`.
#[pyfunction(name = "_restore_stereo_tracker")]
#[pyo3(signature = (state, gain))]
pub fn restore_stereo_tracker(py: Python<'_>, state: &[u8], gain: Option<f64>) -> Outcome<PyStereoTracker> {
    let tracker = py.detach(|| StereoTracker::from_bytes(state))?;
    Ok(PyStereoTracker(Held::new(Tracking { tracker, levels: gain.map(GreyLevels::of_floats) })))
}

/// Numbers that may be missing, as an array with NaN for them.
fn numbers<const N: usize>(py: Python<'_>, values: Option<[f64; N]>) -> Outcome<Bound<'_, PyAny>> {
    arrays::owned::<f64>(py, &[N], values.unwrap_or([f64::NAN; N]).to_vec())
}

/// A cluster, by the names of `jacoflow.track.StereoCluster`.
fn cluster<'py>(py: Python<'py>, node: &Node) -> Outcome<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    out.set_item("time", node.time)?;
    out.set_item("index", node.index)?;
    out.set_item("track_id", node.track_id)?;
    out.set_item("group", node.group)?;
    out.set_item("n_pixels", node.n_pixels)?;
    out.set_item("weight", node.weight)?;
    out.set_item("mean", numbers(py, Some(node.mean))?)?;
    let covariance = node.covariance.as_flattened().to_vec();
    out.set_item("covariance", arrays::owned::<f64>(py, &[3, 3], covariance)?)?;
    out.set_item("velocity", numbers(py, node.velocity)?)?;
    out.set_item("next_velocity", numbers(py, node.next_velocity)?)?;
    out.set_item("middle", numbers(py, Some(node.middle))?)?;
    out.set_item("affine", numbers(py, node.affine)?)?;
    out.set_item("next_affine", numbers(py, node.next_affine)?)?;
    out.set_item("residual", node.residual.unwrap_or(f64::NAN))?;
    out.set_item("coasting", node.coasting)?;
    out.set_item("depth", node.depth.unwrap_or(f64::NAN))?;
    out.set_item("metric_velocity", numbers(py, node.metric_velocity)?)?;
    Ok(out)
}

/// A step, by the names of `jacoflow.track.StereoStep`.
fn step_dict(py: Python<'_>, step: Step) -> Outcome<Bound<'_, PyDict>> {
    let out = PyDict::new(py);
    let count = [step.rows.len()];
    let clusters = step.clusters.iter().map(|node| cluster(py, node)).collect::<Outcome<Vec<_>>>()?;
    out.set_item("time", step.time)?;
    out.set_item("clock", step.clock)?;
    out.set_item("clusters", clusters)?;
    out.set_item("rows", arrays::owned(py, &count, step.rows)?)?;
    out.set_item("cols", arrays::owned(py, &count, step.columns)?)?;
    out.set_item("values", arrays::owned(py, &count, step.disparities)?)?;
    out.set_item("cluster_of_pixel", arrays::owned(py, &count, step.labels)?)?;
    out.set_item("left_out", step.left_out)?;
    out.set_item("row_offset", step.row_offset.unwrap_or(f64::NAN))?;
    out.set_item("rows_doubtful", step.rows_doubtful)?;
    out.set_item("rounds", step.rounds)?;
    Ok(out)
}

/// The compiled part of `jacoflow.track.TrackGraph`.
#[pyclass(name = "_TrackGraph", module = "jacoflow._jacoflow", frozen, eq)]
#[derive(PartialEq)]
pub struct PyTrackGraph(TrackGraph);

#[pymethods]
impl PyTrackGraph {
    /// From the text that `to_json` gives.
    #[staticmethod]
    fn from_json(json: &str) -> Outcome<Self> {
        Ok(Self(TrackGraph::from_json(json)?))
    }

    /// As JSON text.
    fn to_json(&self) -> Outcome<String> {
        Ok(self.0.to_json()?)
    }

    /// Clusters as dictionaries, by time and index.
    fn nodes<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyList>> {
        Ok(PyList::new(py, self.0.nodes().map(|node| cluster(py, node)).collect::<Outcome<Vec<_>>>()?)?)
    }

    /// Arcs as (time, from, to, forward, backward).
    fn arcs(&self) -> Vec<(usize, usize, usize, f64, f64)> {
        self.0.arcs().map(|arc| (arc.time, arc.from, arc.to, arc.forward, arc.backward)).collect()
    }

    /// Clusters (time, index) reached from one along arcs with at least this score.
    fn follow(
        &self,
        time: usize,
        index: usize,
        threshold: f64,
        #[pyo3(from_py_with = named::backward)] backward: bool,
    ) -> Outcome<Vec<(usize, usize)>> {
        Ok(self.0.follow(time, index, threshold, backward)?)
    }
}
