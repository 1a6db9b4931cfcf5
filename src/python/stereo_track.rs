//! The stereo tracker for Python: views in, plain values out; the classes a user meets are in `jacoflow.track`.

use super::arrays::{self, ColourRule};
use super::stereo::in_levels;
use crate::error::Error;
use crate::parallel::Threads;
use crate::stereo::Method;
use crate::track::GreyLevels;
use crate::track::stereo::{
    EdgePoints, Grouping, Node, Recognition, Step, StereoCamera, StereoMode, StereoTracker, StereoTrackerOptions,
    TrackGraph,
};
use crate::types::{AnyFrame, Frame};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The keyword options of `jacoflow.track.StereoTracker`; none: the mode's default.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Given {
    mode: String,
    n_components: Option<usize>,
    weight_concentration_prior: f64,
    mean_precision_prior: f64,
    degrees_of_freedom_prior: f64,
    covariance_prior: f64,
    max_iter: usize,
    warm_max_iter: usize,
    tol: Tolerance,
    n_init: usize,
    prune_weight: f64,
    random_state: u64,
    disparity_range: [i32; 2],
    row_range: [i32; 2],
    row_offset: Option<f64>,
    matching: Option<String>,
    grid: (usize, usize, Option<usize>),
    search: usize,
    luminance_levels: usize,
    arc_threshold: f64,
    reseed_below: f64,
    recognition: Option<bool>,
    least_overlap: f64,
    patience: usize,
    tolerance: [f64; 3],
    tolerance_per_step: [f64; 3],
    coast: usize,
    jump: (f64, f64),
    grouping: Option<bool>,
    group_limits: (f64, f64, f64),
    focal: Option<f64>,
    baseline: Option<f64>,
    d_infinity: f64,
    threads: Option<usize>,
}

/// `tol="auto"`, a number or None.
#[derive(FromPyObject)]
enum Tolerance {
    Word(String),
    Number(Option<f64>),
}

impl Given {
    fn options(self) -> PyResult<StereoTrackerOptions> {
        let Some(mode) = StereoMode::ALL.into_iter().find(|mode| mode.name() == self.mode) else {
            return Err(Error::argument("mode", "\"improved\" or \"paper\"", format!("{:?}", self.mode)).into());
        };
        let mut options = StereoTrackerOptions::new(mode);
        options.tol = match self.tol {
            Tolerance::Number(tol) => tol,
            Tolerance::Word(word) if word == "auto" => options.tol,
            Tolerance::Word(word) => {
                return Err(Error::argument("tol", "\"auto\", a number or None", format!("{word:?}")).into());
            }
        };
        options = options.with_disparities(self.disparity_range);
        let (rows, columns, layers) = self.grid;
        options.grid.rows = rows;
        options.grid.columns = columns;
        options.grid.layers = layers.unwrap_or(options.grid.layers);
        options.row_range = self.row_range;
        options.row_offset = self.row_offset;
        if let Some(matching) = self.matching {
            options.matching = Method::ALL
                .into_iter()
                .find(|method| method.name() == matching)
                .ok_or_else(|| Error::argument("matching", "\"classes\" or \"sgm\"", format!("{matching:?}")))?;
        }
        options.components = self.n_components.unwrap_or(options.components);
        options.weight_concentration_prior = self.weight_concentration_prior;
        options.mean_precision_prior = self.mean_precision_prior;
        options.degrees_of_freedom_prior = self.degrees_of_freedom_prior;
        options.covariance_prior = self.covariance_prior;
        options.max_iter = self.max_iter;
        options.warm_max_iter = self.warm_max_iter;
        options.n_init = self.n_init;
        options.prune_weight = self.prune_weight;
        options.seed = self.random_state;
        options.search = self.search;
        options.luminance_levels = self.luminance_levels;
        options.arc_threshold = self.arc_threshold;
        options.reseed_below = self.reseed_below;
        options.recognition = self.recognition.unwrap_or(options.recognition.is_some()).then_some(Recognition {
            least_overlap: self.least_overlap,
            patience: self.patience,
            tolerance: self.tolerance,
            tolerance_per_step: self.tolerance_per_step,
            coast: self.coast,
            jump: self.jump.0,
            jump_disparity: self.jump.1,
            ..Recognition::default()
        });
        let (reach, motion, depth_motion) = self.group_limits;
        options.grouping =
            self.grouping.unwrap_or(options.grouping.is_some()).then_some(Grouping { reach, motion, depth_motion });
        options.camera = match (self.focal, self.baseline) {
            (Some(focal), Some(baseline)) => Some(StereoCamera { focal, baseline, d_infinity: self.d_infinity }),
            (None, None) => None,
            (None, Some(_)) => {
                return Err(Error::argument("focal", "a length in px beside the baseline", "None").into());
            }
            (Some(_), None) => {
                return Err(Error::argument("baseline", "a length beside the focal length", "None").into());
            }
        };
        options.threads = Threads::new(self.threads)?;
        Ok(options)
    }
}

/// The compiled part of `jacoflow.track.StereoTracker`.
#[pyclass(name = "_StereoTracker", module = "jacoflow._jacoflow", frozen)]
pub struct PyStereoTracker(Mutex<Tracking>);

struct Tracking {
    tracker: StereoTracker,
    /// Decided by the first views, unless they are too dark to.
    levels: Option<GreyLevels>,
}

impl PyStereoTracker {
    fn lock(&self) -> MutexGuard<'_, Tracking> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Tracking {
    /// A step from views, the left one first, in grey levels: views with which no step can be taken say nothing of the scale of floats.
    fn step<const N: usize>(
        &mut self,
        views: &[AnyFrame; N],
        take: impl FnOnce(&mut StereoTracker, [Frame<f32>; N]) -> crate::error::Result<Step>,
    ) -> crate::error::Result<Step> {
        let levels = match self.levels {
            Some(known) => known.revised(views),
            None => GreyLevels::decide_together(views),
        };
        let step = take(&mut self.tracker, views.each_ref().map(|view| in_levels(view, levels.gain(view))))?;
        self.levels = Some(levels);
        Ok(step)
    }
}

#[pymethods]
impl PyStereoTracker {
    #[new]
    fn new(options: &Bound<'_, PyDict>) -> PyResult<Self> {
        let options = options.extract::<Given>()?.options()?;
        Ok(Self(Mutex::new(Tracking { tracker: StereoTracker::new(options)?, levels: None })))
    }

    /// The next step from both views, as a dictionary.
    fn update<'py>(&self, left: &Bound<'py, PyAny>, right: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
        let py = left.py();
        let views = [
            arrays::frame("left", left, ColourRule::Luminance)?,
            arrays::frame("right", right, ColourRule::Luminance)?,
        ];
        let step = py.detach(|| self.lock().step(&views, |tracker, [left, right]| tracker.update(&left, &right)))?;
        told(py, step)
    }

    /// The next step from the left view and its disparities, NaN where there is none, as a dictionary.
    fn update_disparity<'py>(
        &self,
        left: &Bound<'py, PyAny>,
        disparity: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let py = left.py();
        let left = arrays::frame("left", left, ColourRule::Luminance)?;
        let disparity = match arrays::frame("disparity", disparity, ColourRule::Refuse)? {
            map @ (AnyFrame::F32(_) | AnyFrame::F64(_)) => map.to_real::<f32>(),
            other => {
                let message = format!("disparity: expected an array of float32 or float64, got {}", other.dtype());
                return Err(PyTypeError::new_err(message));
            }
        };
        if left.size() != disparity.size() {
            let told = |(width, height): (usize, usize)| format!("({height}, {width})");
            let expected = format!("the left view's shape {}", told(left.size()));
            return Err(Error::argument("disparity", expected, told(disparity.size())).into());
        }
        let points = EdgePoints::from_map(&disparity);
        let step = py.detach(|| self.lock().step(&[left], |tracker, [left]| tracker.update_edges(&left, points)))?;
        told(py, step)
    }

    /// How many rows lower the right view shows a point, where that is known.
    fn row_offset(&self) -> Option<f64> {
        self.lock().tracker.row_offset()
    }

    /// Clusters of all steps so far and their arcs.
    fn graph(&self) -> PyTrackGraph {
        PyTrackGraph(self.lock().tracker.graph().clone())
    }

    /// Tracks by id: times (T,), positions (T, 3) and velocities (T, 3).
    fn tracks<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let out = PyDict::new(py);
        for (id, track) in self.lock().tracker.tracks() {
            let count = track.times.len();
            let times = track.times.iter().map(|&time| time as i64).collect();
            let flat = |values: &[[f64; 3]]| values.iter().flatten().copied().collect();
            let parts = (
                arrays::owned::<i64>(py, &[count], times)?,
                arrays::owned::<f64>(py, &[count, 3], flat(&track.positions))?,
                arrays::owned::<f64>(py, &[count, 3], flat(&track.velocities))?,
            );
            out.set_item(id, parts)?;
        }
        Ok(out)
    }
}

/// Numbers that may be missing, as an array with NaN for them.
fn numbers<const N: usize>(py: Python<'_>, values: Option<[f64; N]>) -> PyResult<Bound<'_, PyAny>> {
    Ok(arrays::owned::<f64>(py, &[N], values.unwrap_or([f64::NAN; N]).to_vec())?.into_any())
}

/// A cluster, by the names of `jacoflow.track.StereoCluster`.
fn cluster<'py>(py: Python<'py>, node: &Node) -> PyResult<Bound<'py, PyDict>> {
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
fn told(py: Python<'_>, step: Step) -> PyResult<Bound<'_, PyDict>> {
    let out = PyDict::new(py);
    let count = [step.rows.len()];
    let clusters = step.clusters.iter().map(|node| cluster(py, node)).collect::<PyResult<Vec<_>>>()?;
    out.set_item("time", step.time)?;
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
    fn from_json(json: &str) -> PyResult<Self> {
        Ok(Self(TrackGraph::from_json(json)?))
    }

    /// As JSON text.
    fn to_json(&self) -> PyResult<String> {
        Ok(self.0.to_json()?)
    }

    /// Clusters as dictionaries, by time and index.
    fn nodes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        PyList::new(py, self.0.nodes().map(|node| cluster(py, node)).collect::<PyResult<Vec<_>>>()?)
    }

    /// Arcs as (time, from, to, forward, backward).
    fn arcs(&self) -> Vec<(usize, usize, usize, f64, f64)> {
        self.0.arcs().map(|arc| (arc.time, arc.from, arc.to, arc.forward, arc.backward)).collect()
    }

    /// Clusters (time, index) reached from one along arcs with at least this score.
    fn follow(&self, time: usize, index: usize, threshold: f64, backward: bool) -> PyResult<Vec<(usize, usize)>> {
        Ok(self.0.follow(time, index, threshold, backward)?)
    }
}
