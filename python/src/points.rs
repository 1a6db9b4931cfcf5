//! Corners, and flow at points.

use super::arrays::{self, ColourRule};
use crate::errors::Outcome;
use crate::interrupt::interruptible;
use crate::options::{self, Integer, named};
use jacoflow::error::{Error, shape_text};
use jacoflow::flow::points::{PointFlowOptions, PointPyramid, track_points};
use jacoflow::image::{CornerOptions, corner_score, select_corners};
use jacoflow::types::Frame;
use pyo3::prelude::*;

/// `(N, 2)` numbers as points; an empty list is none.
fn points(argument: &'static str, object: &Bound<'_, PyAny>) -> Outcome<Vec<[f64; 2]>> {
    let (shape, values) = arrays::doubles(argument, object)?;
    match shape[..] {
        [0] | [_, 2] => Ok(values.as_chunks::<2>().0.to_vec()),
        _ => Err(Error::argument(argument, "shape (N, 2), columns x and y", shape_text(&shape)).into()),
    }
}

/// A grey frame in single precision, NaN where it is masked.
fn grey(argument: &str, object: &Bound<'_, PyAny>) -> Outcome<Frame<f32>> {
    Ok(arrays::frame_with_gaps(argument, object, ColourRule::Refuse)?.to_real())
}

/// Points as a new array (N, 2).
fn pairs(py: Python<'_>, points: Vec<[f64; 2]>) -> Outcome<Bound<'_, PyAny>> {
    arrays::owned(py, &[points.len(), 2], points.into_flattened())
}

/// Corners of `frame` (H, W): pixels whose surroundings change brightness along both axes (J. Shi, C. Tomasi,
/// "Good features to track", 1994).
///
/// The score is the smaller eigenvalue of the mean of (Ix^2, Ix Iy; Ix Iy, Iy^2) over `window` x `window` px
/// (odd). A corner scores at least `quality` (0 to 1) times the best of the frame and no less than its 8
/// neighbours. It is at least `min_distance` px away from every better corner and from every point of
/// `existing` (N, 2). At most `max_count` corners, `existing` not counted.
///
/// Returns positions (x, y) px, float64 (N, 2), best first. There are no corners where a window touches NaN
/// or a masked pixel. ValueError for a number out of its range and for a colour frame.
#[pyfunction]
#[pyo3(signature = (
    frame, *, max_count=500, quality=0.005, min_distance=6.0, window=3, existing=None, threads=None
))]
pub fn corners<'py>(
    frame: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = named::max_count)] max_count: usize,
    #[pyo3(from_py_with = named::quality)] quality: f64,
    #[pyo3(from_py_with = named::min_distance)] min_distance: f64,
    #[pyo3(from_py_with = named::window)] window: usize,
    existing: Option<Bound<'py, PyAny>>,
    #[pyo3(from_py_with = named::threads)] threads: Option<Integer>,
) -> Outcome<Bound<'py, PyAny>> {
    let py = frame.py();
    let threads = options::threads(threads)?;
    let options = CornerOptions { max_count, quality, min_distance, ..CornerOptions::default() };
    options.check()?;
    let existing = existing.map_or(Ok(Vec::new()), |existing| points("existing", &existing))?;
    let frame = grey("frame", frame)?;
    let found = interruptible(py, || {
        threads.install(|| corner_score(&frame, window).map(|score| select_corners(&score, &existing, &options)))
    })?;
    pairs(py, found)
}

/// Levels between the darkest and the brightest finite sample.
fn span(frame: &Frame<f32>) -> f64 {
    let finite = frame.data().iter().filter(|v| v.is_finite());
    let (low, high) = finite.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)));
    f64::from(high - low).max(0.0)
}

/// Flow at `points` (N, 2), positions (x, y) px, from frame `before` (H, W) to frame `after` (H, W), by
/// gradient steps on a pyramid.
///
/// B. Lucas, T. Kanade, 1981; J.-Y. Bouguet, "Pyramidal implementation of the Lucas Kanade feature tracker",
/// 2000. Minimises the squared differences in a window of `window` x `window` px (odd), on `levels` levels
/// (1: full size alone). A level takes at most `max_steps` steps and ends with one shorter than `min_step`
/// px. `guesses` (N, 2): expected flow, default zero.
///
/// `ok` is False unless the flow back from the new position leads to within `forward_backward` px of the
/// point (None: not tested). A point is lost (NaN) when it leaves the frame, when its window touches NaN or
/// a masked pixel, or when the window has too little structure: smaller eigenvalue of its mean structure
/// tensor below `min_eigenvalue`, (levels/px)^2. None: 0.1 where the first frame spans 255 levels, scaled by
/// the square of its span.
///
/// Returns flow (u, v) px/frame, float64 (N, 2); ok, bool (N,); error, the distance between forward and back,
/// px, float64 (N,). ValueError for a number out of its range, for frames of different shape and for colour
/// frames.
#[pyfunction]
#[pyo3(signature = (
    before, after, points, *, guesses=None, levels=3, window=19, max_steps=30, min_step=0.02, forward_backward=0.7,
    min_eigenvalue=None, threads=None
))]
pub fn point_flow<'py>(
    before: &Bound<'py, PyAny>,
    after: &Bound<'py, PyAny>,
    points: &Bound<'py, PyAny>,
    guesses: Option<Bound<'py, PyAny>>,
    #[pyo3(from_py_with = named::levels)] levels: usize,
    #[pyo3(from_py_with = named::window)] window: usize,
    #[pyo3(from_py_with = named::max_steps)] max_steps: usize,
    #[pyo3(from_py_with = named::min_step)] min_step: f64,
    #[pyo3(from_py_with = named::forward_backward)] forward_backward: Option<f64>,
    #[pyo3(from_py_with = named::min_eigenvalue)] min_eigenvalue: Option<f64>,
    #[pyo3(from_py_with = named::threads)] threads: Option<Integer>,
) -> Outcome<(Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let py = before.py();
    let threads = options::threads(threads)?;
    let (before, after) = (grey("before", before)?, grey("after", after)?);
    let points = self::points("points", points)?;
    let guesses = guesses.map(|guesses| self::points("guesses", &guesses)).transpose()?;
    let default = PointFlowOptions::default();
    let scaled = || default.min_eigenvalue * (span(&before) / 255.0).powi(2);
    let options = PointFlowOptions {
        levels,
        window,
        max_steps,
        min_step,
        forward_backward: forward_backward.unwrap_or(f64::INFINITY),
        min_eigenvalue: min_eigenvalue.unwrap_or_else(scaled),
        simd: None,
    };
    let found = interruptible(py, || {
        threads.install(|| {
            let [before, after] = [before, after].map(|frame| PointPyramid::new(frame, levels));
            track_points(&before, &after, &points, guesses.as_deref(), &options)
        })
    })?;
    let count = [found.len()];
    Ok((
        pairs(py, found.iter().map(|point| point.flow).collect())?,
        arrays::owned(py, &count, found.iter().map(|point| point.ok).collect())?,
        arrays::owned(py, &count, found.iter().map(|point| point.error).collect())?,
    ))
}
