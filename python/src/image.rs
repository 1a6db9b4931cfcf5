//! Frames before any motion is looked for: smoothing, quantising, colour to grey.

use super::arrays::{self, ColourRule};
use crate::errors::Outcome;
use crate::interrupt::interruptible;
use crate::options::{self, Integer, named};
use jacoflow::image::{Border, GaussianSmoother, Quantiser};
use jacoflow::types::AnyFrame;
use pyo3::prelude::*;

/// `$result`, computed from the frame in working precision: float64 for float64 frames, else float32. A
/// macro, since the library keeps the bound of its generic functions to itself.
macro_rules! in_precision {
    ($given:expr, $frame:ident => $result:expr) => {
        match $given {
            AnyFrame::F64($frame) => AnyFrame::F64($result),
            other => {
                let $frame = &other.to_real();
                AnyFrame::F32($result)
            }
        }
    };
}

/// `frame` (H, W) smoothed by a Gaussian of standard deviation `blur_sigma` px, cut off at `truncate`
/// standard deviations, reflecting borders.
///
/// Returns a new array (H, W) in the same grey levels, float64 for float64, else float32. NaN (as masked
/// pixels become) damages only the pixels whose kernel reaches it. ValueError for a negative or infinite
/// `blur_sigma`.
#[pyfunction]
#[pyo3(signature = (frame, blur_sigma, *, truncate=None, threads=None))]
pub fn smooth<'py>(
    frame: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = named::blur_sigma)] blur_sigma: f64,
    #[pyo3(from_py_with = named::truncate)] truncate: Option<f64>,
    #[pyo3(from_py_with = named::threads)] threads: Option<Integer>,
) -> Outcome<Bound<'py, PyAny>> {
    let py = frame.py();
    let frame = arrays::frame_with_gaps("frame", frame, ColourRule::Refuse)?;
    let smoother = match truncate {
        None => GaussianSmoother::new(blur_sigma),
        Some(truncate) => GaussianSmoother::with(blur_sigma, truncate, Border::Reflect),
    };
    let smoother = smoother.map_err(|e| renamed(e, "smooth", "blur_sigma"))?;
    let threads = options::threads(threads)?;
    let smooth = interruptible(py, || Ok(in_precision!(&frame, frame => threads.install(|| smoother.apply(frame)))))?;
    arrays::from_any_frame(py, smooth)
}

/// `frame` (H, W) rounded down to multiples of `step` grey levels: floor(x / step) * step.
///
/// Returns a new array (H, W), float64 for float64, else float32, NaN for masked pixels. ValueError unless
/// `step` is positive.
#[pyfunction]
#[pyo3(signature = (frame, step=None))]
pub fn quantise<'py>(
    frame: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = named::step)] step: Option<f64>,
) -> Outcome<Bound<'py, PyAny>> {
    let py = frame.py();
    let frame = arrays::frame_with_gaps("frame", frame, ColourRule::Refuse)?;
    let quantiser =
        step.map_or(Ok(Quantiser::default()), Quantiser::new).map_err(|e| renamed(e, "quantise", "step"))?;
    let levels = interruptible(py, || Ok(in_precision!(&frame, frame => quantiser.apply(frame))))?;
    arrays::from_any_frame(py, levels)
}

/// Luma 0.299 R + 0.587 G + 0.114 B (ITU-R BT.601) of a colour frame (H, W, 3 or 4) in the order red, green,
/// blue; alpha is left out.
///
/// Returns a new array (H, W) of the same dtype and grey levels; integers are rounded. A grey frame (H, W) is
/// copied.
#[pyfunction]
pub fn luminance<'py>(frame: &Bound<'py, PyAny>) -> Outcome<Bound<'py, PyAny>> {
    arrays::from_any_frame(frame.py(), arrays::frame("frame", frame, ColourRule::Luminance)?)
}

/// The same complaint under the name that this function gives the argument.
pub fn renamed(error: jacoflow::Error, core: &str, here: &'static str) -> jacoflow::Error {
    match error {
        jacoflow::Error::Argument { argument, expected, got } if argument == core => {
            jacoflow::Error::Argument { argument: here, expected, got }
        }
        jacoflow::Error::Type { argument, expected, got } if argument == core => {
            jacoflow::Error::Type { argument: here, expected, got }
        }
        other => other,
    }
}
