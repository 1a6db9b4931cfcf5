//! `estimate` and `FlowEstimator`.

mod arguments;
mod memory;

use super::arrays::{self, Frames};
use super::field::{FlowField, Packed};
use super::progress::Reporter;
use crate::error::Error;
use crate::types::{AnyFrame, Frame};
use arguments::{Arguments, PAIR, Plan};
use memory::{AnyField, Memory, Ring};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::collections::VecDeque;

use super::options::{self, Object};

impl AnyField {
    fn single(self) -> FlowField {
        match self {
            Self::Single(field) => FlowField::single(field),
            Self::Double(field) => FlowField::single(field),
        }
    }
}

/// Fields of a stack as they come.
enum Growing {
    None,
    Single(Packed<f32>),
    Double(Packed<f64>),
}

impl Growing {
    fn add(&mut self, field: AnyField) -> crate::Result<()> {
        match (&mut *self, field) {
            (Self::Single(packed), AnyField::Single(field)) => packed.append(field),
            (Self::Double(packed), AnyField::Double(field)) => packed.append(field),
            (_, AnyField::Single(field)) => {
                *self = Self::Single(Packed::one(field));
                Ok(())
            }
            (_, AnyField::Double(field)) => {
                *self = Self::Double(Packed::one(field));
                Ok(())
            }
        }
    }

    fn finish(self) -> PyResult<FlowField> {
        match self {
            Self::Single(packed) => Ok(FlowField::stack(packed)),
            Self::Double(packed) => Ok(FlowField::stack(packed)),
            Self::None => Err(Error::Numerical("no field came of the frames".into()).into()),
        }
    }
}

/// The field or fields of a whole sequence.
fn run(py: Python<'_>, frames: &Frames<'_>, plan: &Plan, progress: &Reporter<'_>) -> PyResult<FlowField> {
    let needed = plan.estimator.frames_needed();
    if frames.count < needed {
        let expected = format!("at least {needed} frames");
        return Err(Error::argument("frames", expected, format!("{} frames", frames.count)).into());
    }
    let (mut memory, mut fields) = (Memory::Empty, Growing::None);
    for index in 0..frames.count {
        let field = memory.push(py, "frames", plan, &frames.get(index)?)?;
        progress.step(index + 1, frames.count)?;
        if let Some(field) = field {
            if !frames.is_array && frames.count == needed {
                return Ok(field.single());
            }
            fields.add(field)?;
        }
    }
    fields.finish()
}

/// Flow, its Jacobian and their covariance, from two or three frames or from a stack.
///
/// A list or tuple of three frames (H, W) gives one FlowField (H, W), one of two frames as well (every method but "instantaneous"); a longer list
/// gives a stack (T - 2, H, W), and so does an array (T, H, W) of any length. Frames are uint8, uint16, float32 or float64 in any grey scale: the intensity
/// gain does not change the flow. float64 is computed in float64, everything else in float32. Inputs are never modified.
///
/// Parameters
/// ----------
/// frames : array (T, H, W), or list of arrays (H, W)
///     Oldest first, one size, at least 3 x 3 px.
/// method : "windowed", "instantaneous", "lucas_kanade" or "horn_schunck"
///     "windowed": least squares of the transported equations in a Gaussian window. "instantaneous": per pixel, WO2010/098160 (34), for locally quadratic,
///     nearly noise-free images. The others are baselines.
/// model : "affine", "translational" or "accelerating"
///     Motion model of "instantaneous".
/// time_scheme : "central", "backward" or "pair"
///     How time derivatives are taken, and so to which frame the field belongs: the middle one of three (default), the newest of three ("windowed" and
///     "instantaneous" only), or the first of two (the default for two frames; not "instantaneous").
/// neighbourhood : (columns, rows) or array (N, 2) of offsets (x, y), px
///     Pixels that the local quadratic is fitted to; default 3 x 3.
/// neighbourhood_sigma : float, px
///     Weighs them by a Gaussian; default equal weights.
/// window_sigma : float, px
///     Standard deviation of the window of "windowed" and "lucas_kanade"; default 4.
/// rows : "brightness", "gradient", "jet" or "all"
///     Equations that "windowed" sums: 1, 3, 6 or 12 at each pixel.
/// smoothness : float, grey levels per px
///     Weight of "horn_schunck"; default the root mean square gradient.
/// iterations : int
///     Most iterations of "horn_schunck".
/// rank_deficient : "nan" or "min_norm"
///     What "windowed" and "instantaneous" report where the equations do not determine every unknown.
/// smooth : float, px
///     Standard deviation of a Gaussian that smooths each frame first; default none.
/// quantise : float, grey levels
///     Rounds samples down to multiples of it before smoothing; default none.
/// colour : "error" (default) or "luminance"
///     What to do with frames (H, W, 3 or 4).
/// points : array (N, 2) of int, px
///     Pixels (x, y) to estimate at, nothing else is computed; arrays of the result are (..., N) instead of (..., H, W).
/// region : (x, y, width, height), px
///     Rectangle to estimate in.
/// stride : int, px
///     Estimate at every stride-th column and row.
/// mask : bool array (H, W)
///     True where pixels may be used.
/// fps, frame_period : float, frames/s or s
///     For quantities per second; give one of them.
/// pixel_pitch : float or (dx, dy), any length unit
///     Size of a pixel; flow then comes in that unit per frame.
/// covariance : bool
///     Whether to compute the covariance of the parameters; default yes, where the method has one (not "horn_schunck").
/// diagnostics : bool
///     Whether to report residual, rank and condition number.
/// noise : float, grey levels
///     Standard deviation of the pixel noise for the covariance; default from the residual.
/// precision : "float32" or "float64"
///     Default: that of the frames.
/// threads : int
///     Default: environment variable JACOFLOW_THREADS, else every processor. Results do not depend on it.
/// simd : "scalar", "avx2" or "avx512"
///     Default: environment variable JACOFLOW_SIMD, else the best of the processor.
/// progress : None, True or function (done, total)
///     True draws a line on standard error; a function is called after each frame. Ctrl-C stops between frames.
///
/// Raises
/// ------
/// ValueError
///     For fewer than three frames, frames under 3 x 3 px or of different sizes, colour, and options out of range; each message names the argument.
/// TypeError
///     For another dtype.
#[pyfunction]
#[pyo3(signature = (
    frames, *, method="windowed", model="affine", time_scheme=None, neighbourhood=None, neighbourhood_sigma=None, window_sigma=None,
    rows=None, smoothness=None, iterations=None, rank_deficient="nan", smooth=None, quantise=None, colour=None, points=None, region=None,
    stride=None, mask=None, fps=None, frame_period=None, pixel_pitch=None, covariance=None, diagnostics=false, noise=None,
    precision=None, threads=None, simd=None, progress=None
))]
pub fn estimate(
    frames: &Bound<'_, PyAny>,
    method: &str,
    model: &str,
    time_scheme: Option<String>,
    neighbourhood: Object,
    neighbourhood_sigma: Option<f64>,
    window_sigma: Option<f64>,
    rows: Option<String>,
    smoothness: Option<f64>,
    iterations: Option<i64>,
    rank_deficient: &str,
    smooth: Option<f64>,
    quantise: Option<f64>,
    colour: Option<String>,
    points: Object,
    region: Option<(i64, i64, i64, i64)>,
    stride: Option<i64>,
    mask: Object,
    fps: Option<f64>,
    frame_period: Option<f64>,
    pixel_pitch: Object,
    covariance: Option<bool>,
    diagnostics: bool,
    noise: Option<f64>,
    precision: Option<String>,
    threads: Option<i64>,
    simd: Option<String>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<FlowField> {
    let py = frames.py();
    let mut arguments = Arguments {
        method: method.into(),
        model: model.into(),
        time_scheme,
        neighbourhood,
        neighbourhood_sigma,
        window_sigma,
        rows,
        smoothness,
        iterations,
        rank_deficient: rank_deficient.into(),
        smooth,
        quantise,
        colour,
        points,
        region,
        stride,
        mask,
        fps,
        frame_period,
        pixel_pitch,
        covariance,
        diagnostics,
        noise,
        precision,
        threads,
        simd,
    };
    let colour = arrays::ColourRule::parse(arguments.colour.as_deref())?;
    let frames = Frames::new(frames, colour)?;
    if !frames.is_array && frames.count == 2 && arguments.time_scheme.is_none() && arguments.takes_pairs() {
        arguments.time_scheme = Some(PAIR.into());
    }
    run(py, &frames, &arguments.plan(py)?, &Reporter::new(py, progress)?)
}

/// Flow from a stream: frames are pushed one by one, memory stays bounded.
///
/// The options are those of `estimate`; see there for what they mean and their units. A field (H, W) comes as soon as three frames have
/// (two with time_scheme="pair"). Pickles in mid-stream.
#[pyclass(module = "jacoflow")]
pub struct FlowEstimator {
    arguments: Arguments,
    plan: Plan,
    memory: Memory,
}

#[pymethods]
impl FlowEstimator {
    #[new]
    #[pyo3(signature = (
        *, method="windowed", model="affine", time_scheme=None, neighbourhood=None, neighbourhood_sigma=None, window_sigma=None,
        rows=None, smoothness=None, iterations=None, rank_deficient="nan", smooth=None, quantise=None, colour=None, points=None,
        region=None, stride=None, mask=None, fps=None, frame_period=None, pixel_pitch=None, covariance=None, diagnostics=false,
        noise=None, precision=None, threads=None, simd=None
    ))]
    fn new(
        py: Python<'_>,
        method: &str,
        model: &str,
        time_scheme: Option<String>,
        neighbourhood: Object,
        neighbourhood_sigma: Option<f64>,
        window_sigma: Option<f64>,
        rows: Option<String>,
        smoothness: Option<f64>,
        iterations: Option<i64>,
        rank_deficient: &str,
        smooth: Option<f64>,
        quantise: Option<f64>,
        colour: Option<String>,
        points: Object,
        region: Option<(i64, i64, i64, i64)>,
        stride: Option<i64>,
        mask: Object,
        fps: Option<f64>,
        frame_period: Option<f64>,
        pixel_pitch: Object,
        covariance: Option<bool>,
        diagnostics: bool,
        noise: Option<f64>,
        precision: Option<String>,
        threads: Option<i64>,
        simd: Option<String>,
    ) -> PyResult<Self> {
        Self::from_arguments(
            py,
            Arguments {
                method: method.into(),
                model: model.into(),
                time_scheme,
                neighbourhood,
                neighbourhood_sigma,
                window_sigma,
                rows,
                smoothness,
                iterations,
                rank_deficient: rank_deficient.into(),
                smooth,
                quantise,
                colour,
                points,
                region,
                stride,
                mask,
                fps,
                frame_period,
                pixel_pitch,
                covariance,
                diagnostics,
                noise,
                precision,
                threads,
                simd,
            },
        )
    }

    /// Takes the next frame (H, W), in any grey unit; returns a FlowField (px/frame) once enough frames have come, before that None.
    ///
    /// A frame that raises an error (ValueError for another size, TypeError for another dtype) is not kept.
    fn push(&mut self, frame: &Bound<'_, PyAny>) -> PyResult<Option<FlowField>> {
        let py = frame.py();
        let frame = arrays::frame("frame", frame, self.plan.colour)?;
        Ok(self.memory.push(py, "frame", &self.plan, &frame)?.map(AnyField::single))
    }

    /// Forgets every frame (H, W); the next one begins a new sequence, frame index 0.
    fn reset(&mut self) {
        self.memory = Memory::Empty;
    }

    /// Frames that must come before the first field (a count, no unit).
    #[getter]
    fn frames_needed(&self) -> usize {
        self.plan.estimator.frames_needed()
    }

    /// How many frames have been pushed since the start or the last reset (a count, no unit).
    #[getter]
    fn frames_pushed(&self) -> usize {
        match &self.memory {
            Memory::Empty => 0,
            Memory::Single(ring) => ring.pushed,
            Memory::Double(ring) => ring.pushed,
        }
    }

    /// The options as a dictionary, in the units of `estimate`.
    #[getter]
    fn options<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.arguments.copy(py).into_pyobject(py)
    }

    fn __repr__(&self) -> String {
        format!("FlowEstimator(method={:?}, frames_pushed={})", self.arguments.method, self.frames_pushed())
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyDict>, Bound<'py, PyDict>))> {
        let memory = PyDict::new(py);
        match &self.memory {
            Memory::Empty => {}
            Memory::Single(ring) => save(&memory, ring)?,
            Memory::Double(ring) => save(&memory, ring)?,
        }
        let restore = py.import("jacoflow._jacoflow")?.getattr("_restore_estimator")?;
        Ok((restore, (self.options(py)?, memory)))
    }
}

impl FlowEstimator {
    fn from_arguments(py: Python<'_>, arguments: Arguments) -> PyResult<Self> {
        let arguments = arguments.keep(py)?;
        Ok(Self { plan: arguments.plan(py)?, arguments, memory: Memory::Empty })
    }
}

fn save<T: numpy::Element + Clone>(memory: &Bound<'_, PyDict>, ring: &Ring<T>) -> PyResult<()> {
    let py = memory.py();
    let frames = ring.frames.iter().map(|frame| arrays::from_frame(py, frame.clone()));
    memory.set_item("frames", PyList::new(py, frames.collect::<PyResult<Vec<_>>>()?)?)?;
    memory.set_item("pushed", ring.pushed)?;
    memory.set_item("dtype", ring.dtype)
}

/// The inverse of `FlowEstimator.__reduce__`.
#[pyfunction(name = "_restore_estimator")]
pub fn restore_estimator(py: Python<'_>, options: Arguments, memory: &Bound<'_, PyDict>) -> PyResult<FlowEstimator> {
    let mut estimator = FlowEstimator::from_arguments(py, options)?;
    let Some(frames) = memory.get_item("frames")? else { return Ok(estimator) };
    let missing = || Error::argument("memory", "the entries frames, pushed and dtype", "fewer");
    let pushed: usize = memory.get_item("pushed")?.ok_or_else(missing)?.extract()?;
    let dtype: String = memory.get_item("dtype")?.ok_or_else(missing)?.extract()?;
    let dtype = options::known_dtype(&dtype)?;
    let mut single: VecDeque<Frame<f32>> = VecDeque::new();
    let mut double: VecDeque<Frame<f64>> = VecDeque::new();
    for frame in frames.try_iter()? {
        match arrays::frame("memory", &frame?, arrays::ColourRule::Refuse)? {
            AnyFrame::F64(frame) => double.push_back(frame),
            other => single.push_back(other.to_real()),
        }
    }
    estimator.memory = if double.is_empty() {
        Memory::Single(Ring { frames: single, pushed, dtype })
    } else {
        Memory::Double(Ring { frames: double, pushed, dtype })
    };
    Ok(estimator)
}
