//! Disparity for Python: two views in, arrays out; what a user meets is in `jacoflow.stereo`.

use super::arrays::{self, ColourRule};
use crate::parallel::Threads;
use crate::stereo::{self, EdgeDisparityOptions, Method};
use crate::track::GreyLevels;
use crate::types::{AnyFrame, Frame};
use pyo3::prelude::*;

/// Both views in 8-bit grey levels; the left one decides what the white of floats is.
fn views(left: &Bound<'_, PyAny>, right: &Bound<'_, PyAny>) -> PyResult<[Frame<f32>; 2]> {
    let left = arrays::frame("left", left, ColourRule::Luminance)?;
    let right = arrays::frame("right", right, ColourRule::Luminance)?;
    let levels = GreyLevels::decide(&left);
    Ok([&left, &right].map(|view| in_levels(view, levels.gain(view))))
}

/// Samples times a gain, in single precision.
fn in_levels(view: &AnyFrame, gain: f64) -> Frame<f32> {
    match view {
        AnyFrame::F64(frame) => frame.map(|&value| (value * gain) as f32),
        other => other.to_real::<f32>().map(|&value| (f64::from(value) * gain) as f32),
    }
}

/// The arguments that both functions share.
fn options(
    method: &str,
    disparity_range: (i32, i32),
    row_range: (i32, i32),
    sigma: f64,
    threshold: f64,
    classes: usize,
    window: usize,
    min_support: f64,
    threads: Option<usize>,
) -> PyResult<EdgeDisparityOptions> {
    Ok(EdgeDisparityOptions {
        method: Method::parse(method)?,
        disparity_range,
        row_range,
        sigma,
        threshold,
        classes,
        window,
        min_support,
        threads: Threads::new(threads)?,
        ..EdgeDisparityOptions::default()
    })
}

/// The compiled part of `jacoflow.stereo.edge_disparity`: disparity (H, W), then rows, columns, values and scores (N,), then the row offset.
#[pyfunction(name = "_edge_disparity")]
pub fn edge_disparity<'py>(
    left: &Bound<'py, PyAny>,
    right: &Bound<'py, PyAny>,
    method: &str,
    disparity_range: (i32, i32),
    row_range: (i32, i32),
    row_offset: Option<f64>,
    subpixel: bool,
    check: bool,
    prior: Option<&Bound<'py, PyAny>>,
    prior_radius: u32,
    sigma: f64,
    threshold: f64,
    classes: usize,
    window: usize,
    min_support: f64,
    threads: Option<usize>,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, f64)> {
    let py = left.py();
    let common = options(method, disparity_range, row_range, sigma, threshold, classes, window, min_support, threads)?;
    let [left, right] = views(left, right)?;
    let prior = prior.map(|prior| arrays::frame("prior", prior, ColourRule::Refuse)).transpose()?;
    let prior = prior.map(|prior| prior.to_real::<f32>());
    let options = EdgeDisparityOptions { row_offset, subpixel, check, prior, prior_radius, ..common };
    let found = py.detach(|| stereo::edge_disparity(&left, &right, &options))?;
    let count = [found.rows.len()];
    Ok((
        arrays::from_frame(py, found.disparity)?,
        arrays::owned(py, &count, found.rows)?.into_any(),
        arrays::owned(py, &count, found.columns)?.into_any(),
        arrays::owned(py, &count, found.values)?.into_any(),
        arrays::owned(py, &count, found.scores)?.into_any(),
        found.row_offset,
    ))
}

/// The compiled part of `jacoflow.stereo.estimate_row_offset`: rows.
#[pyfunction(name = "_estimate_row_offset")]
pub fn estimate_row_offset(
    left: &Bound<'_, PyAny>,
    right: &Bound<'_, PyAny>,
    disparity_range: (i32, i32),
    row_range: (i32, i32),
    sigma: f64,
    threshold: f64,
    classes: usize,
    window: usize,
    min_support: f64,
    threads: Option<usize>,
) -> PyResult<f64> {
    let options =
        options("sgm", disparity_range, row_range, sigma, threshold, classes, window, min_support, threads)?;
    let py = left.py();
    let [left, right] = views(left, right)?;
    Ok(py.detach(|| stereo::estimate_row_offset(&left, &right, &options))?)
}
