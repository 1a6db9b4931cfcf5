//! Disparity for Python: two views in, arrays out; what a user meets is in `jacoflow.stereo`.

use super::arrays::{self, ColourRule};
use crate::errors::Outcome;
use crate::interrupt::{abandonable, interruptible};
use crate::options::{self, Integer, named};
use jacoflow::error::{Error, Result};
use jacoflow::io::{DisparityFormat, DisparityMap};
use jacoflow::stereo::{self, EdgeDisparityOptions, EdgeMap, EdgeSettings, Method, RowOffset};
use jacoflow::track::GreyLevels;
use jacoflow::types::{AnyFrame, Frame, Sample};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::{Path, PathBuf};

/// Views in 8-bit grey levels, NaN where they are masked; those of floats decide together what their white
/// is.
fn grey_levels<const N: usize>(views: [(&str, &Bound<'_, PyAny>); N]) -> Outcome<[Frame<f32>; N]> {
    let (mut frames, mut levels) = (Vec::with_capacity(N), GreyLevels::of_integers());
    for (name, view) in views {
        let (frame, given) = arrays::typed_frame(name, view, ColourRule::Luminance)?;
        // Masked integers are floats in the frame, and have the white of integers.
        if given == frame.dtype() {
            levels = levels.revised(std::slice::from_ref(&frame));
        }
        let is_bool = arrays::dtype_name(&arrays::native(name, view)?) == "bool";
        frames.push((frame, if is_bool { "bool" } else { given }));
    }
    Ok(std::array::from_fn(|i| {
        let (frame, given) = &frames[i];
        let gain = match *given {
            "bool" => 255.0,
            u8::DTYPE => 1.0,
            u16::DTYPE => 1.0 / 257.0,
            _ => levels.float_gain(),
        };
        in_levels(frame, gain)
    }))
}

/// Samples times a gain, in single precision.
pub(super) fn in_levels(view: &AnyFrame, gain: f64) -> Frame<f32> {
    match view {
        AnyFrame::F64(frame) => frame.map(|&value| (value * gain) as f32),
        other => other.to_real::<f32>().map(|&value| (f64::from(value) * gain) as f32),
    }
}

/// The keyword options that both functions have.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Search {
    disparity_range: (i32, i32),
    row_range: (i32, i32),
    blur_sigma: f64,
    threshold: f64,
    #[pyo3(from_py_with = named::classes)]
    classes: usize,
    #[pyo3(from_py_with = named::window)]
    window: usize,
    min_support: f64,
    #[pyo3(from_py_with = named::threads)]
    threads: Option<Integer>,
}

/// The keyword options of `edge_disparity` alone.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Matching<'py> {
    method: String,
    row_offset: Option<f64>,
    #[pyo3(from_py_with = named::subpixel)]
    subpixel: bool,
    #[pyo3(from_py_with = named::left_right_check)]
    left_right_check: bool,
    prior: Option<Bound<'py, PyAny>>,
    #[pyo3(from_py_with = named::prior_radius)]
    prior_radius: u32,
}

impl Search {
    fn options(self) -> Outcome<EdgeDisparityOptions> {
        Ok(EdgeDisparityOptions {
            disparity_range: self.disparity_range,
            row_range: self.row_range,
            blur_sigma: self.blur_sigma,
            threshold: self.threshold,
            classes: self.classes,
            window: self.window,
            min_support: self.min_support,
            threads: options::threads(self.threads)?,
            ..EdgeDisparityOptions::default()
        })
    }
}

impl Matching<'_> {
    /// With these options, too.
    fn add_to(self, options: EdgeDisparityOptions) -> Outcome<EdgeDisparityOptions> {
        let prior = self.prior.map(|prior| arrays::frame_with_gaps("prior", &prior, ColourRule::Refuse)).transpose()?;
        Ok(EdgeDisparityOptions {
            method: Method::parse(&self.method)?,
            row_offset: self.row_offset,
            subpixel: self.subpixel,
            left_right_check: self.left_right_check,
            prior: prior.map(|prior| prior.to_real::<f32>()),
            prior_radius: self.prior_radius,
            ..options
        })
    }
}

/// What `_edge_disparity` gives.
type Matched<'py> =
    (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, (f64, bool));

/// The compiled part of `jacoflow.stereo.edge_disparity`: disparity (H, W), then rows, columns, values and
/// scores (N,), then the row offset and whether it is to be doubted.
#[pyfunction(name = "_edge_disparity")]
pub fn edge_disparity<'py>(
    left: &Bound<'py, PyAny>,
    right: &Bound<'py, PyAny>,
    options: &Bound<'py, PyDict>,
) -> Outcome<Matched<'py>> {
    let py = left.py();
    let (search, matching): (Search, Matching<'_>) = (options.extract()?, options.extract()?);
    let options = matching.add_to(search.options()?)?;
    let [left, right] = grey_levels([("left", left), ("right", right)])?;
    let found = interruptible(py, || stereo::edge_disparity(&left, &right, &options))?;
    let count = [found.rows.len()];
    Ok((
        arrays::from_frame(py, found.disparity)?,
        arrays::owned(py, &count, found.rows)?,
        arrays::owned(py, &count, found.columns)?,
        arrays::owned(py, &count, found.values)?,
        arrays::owned(py, &count, found.scores)?,
        (found.row_offset, found.rows_doubtful),
    ))
}

/// The compiled part of `jacoflow.stereo.estimate_row_offset`: rows, and whether they are to be doubted.
#[pyfunction(name = "_estimate_row_offset")]
pub fn estimate_row_offset(
    left: &Bound<'_, PyAny>,
    right: &Bound<'_, PyAny>,
    options: &Bound<'_, PyDict>,
) -> Outcome<(f64, bool)> {
    let options = options.extract::<Search>()?.options()?;
    let py = left.py();
    let [left, right] = grey_levels([("left", left), ("right", right)])?;
    let RowOffset { rows, doubtful } = interruptible(py, || stereo::find_row_offset(&left, &right, &options))?;
    Ok((rows, doubtful))
}

/// The compiled part of `jacoflow.stereo.edge_pixels`: rows and columns (N,).
#[pyfunction(name = "_edge_pixels")]
pub fn edge_pixels<'py>(
    view: &Bound<'py, PyAny>,
    blur_sigma: f64,
    threshold: f64,
    #[pyo3(from_py_with = named::threads)] threads: Option<Integer>,
) -> Outcome<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let py = view.py();
    let threads = options::threads(threads)?;
    let options = EdgeDisparityOptions { blur_sigma, threshold, ..EdgeDisparityOptions::default() };
    options.check()?;
    let [view] = grey_levels([("view", view)])?;
    let settings = EdgeSettings { blur_sigma, threshold, classes: options.classes };
    let map = interruptible(py, || Ok(threads.install(|| EdgeMap::new(&view, &settings))))?;
    let count = [map.len()];
    Ok((arrays::owned(py, &count, map.rows)?, arrays::owned(py, &count, map.columns)?))
}

/// The format that a file's name means.
fn format_of(path: &Path) -> Result<DisparityFormat> {
    let wanted = "a file name that ends in .npz, .pfm or .png";
    DisparityFormat::of(path).ok_or_else(|| Error::argument("path", wanted, path.display()))
}

/// The compiled part of `jacoflow.io.read_disparity`: disparity (H, W), px.
#[pyfunction(name = "_read_disparity")]
pub fn read_disparity(py: Python<'_>, #[pyo3(from_py_with = named::path)] path: PathBuf) -> Outcome<Bound<'_, PyAny>> {
    let format = format_of(&path)?;
    arrays::from_frame(py, abandonable(py, move || format.read(&path))?.disparity)
}

/// The compiled part of `jacoflow.io.write_disparity`: how many disparities the format could not hold.
#[pyfunction(name = "_write_disparity")]
pub fn write_disparity(
    #[pyo3(from_py_with = named::path)] path: PathBuf,
    disparity: &Bound<'_, PyAny>,
) -> Outcome<usize> {
    let format = format_of(&path)?;
    let map = DisparityMap::plain(arrays::frame("disparity", disparity, ColourRule::Refuse)?.to_real());
    Ok(disparity.py().detach(|| format.write(&path, &map))?)
}
