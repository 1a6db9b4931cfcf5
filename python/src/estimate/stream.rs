//! `FlowEstimator`: flow from frames that come one by one.

use super::{arguments::Arguments, arguments::estimator_options};
use crate::arrays::{self, ColourRule};
use crate::errors::Outcome;
use crate::interrupt::{alone, interruptible};
use crate::options::{self, Integer, Object, named};
use crate::{field::FlowField, image::renamed, keywords::constructor, keywords::with_common};
use jacoflow::error::Error;
use jacoflow::temporal::{AnyFlowStream, FlowStream, Stream};
use jacoflow::types::AnyFrame;
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

/// Flow from a stream: frames are pushed one by one, memory stays bounded.
///
/// The options are those of `estimate`; see there for what they mean and their units. A field (H, W) comes as
/// soon as three frames have (two with the time scheme "pair"). With temporal="recursive" each field is
/// estimated from all frames so far. Pickles in mid-stream.
#[pyclass(module = "jacoflow")]
pub struct FlowEstimator {
    arguments: Arguments,
    colour: ColourRule,
    stream: AnyFlowStream,
}

estimator_options!(constructor [FlowEstimator from Arguments]);

/// Writes a stream of either precision into `memory`.
macro_rules! save {
    ($memory:expr, $stream:expr) => {{
        let (memory, stream) = ($memory, $stream);
        let py = memory.py();
        let frames = stream.frames().map(|frame| arrays::from_frame(py, frame.clone()));
        memory.set_item("frames", PyList::new(py, frames.collect::<Outcome<Vec<_>>>()?)?)?;
        if let Some((sites, state)) = stream.fused() {
            memory.set_item("fused", (sites, arrays::owned(py, &[state.len()], state.to_vec())?))?;
        }
        memory.set_item("times", stream.times().collect::<Vec<_>>())?;
        memory.set_item("pushed", stream.pushed())?;
    }};
}

#[pymethods]
impl FlowEstimator {
    /// Takes the next frame (H, W), in any grey unit; returns a FlowField (px/frame) once enough frames have
    /// come, before that None.
    ///
    /// `time`, s, is when the frame was taken, for every frame or none: fields are then per second, each by
    /// the time between its own frames, and not `fps`. Where a frame is missing, "coarse_to_fine"
    /// estimates the step to the next one from two frames. A frame that raises an error (ValueError for
    /// another size or a time not after the last, TypeError for another dtype) is not kept. Ctrl-C stops the
    /// work and forgets every frame.
    #[pyo3(signature = (frame, *, time=None))]
    fn push(
        slf: &Bound<'_, Self>,
        frame: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = named::time)] time: Option<f64>,
    ) -> Outcome<Option<FlowField>> {
        let (py, mut this) = (slf.py(), alone(slf)?);
        let (frame, dtype) = arrays::typed_frame("frame", frame, this.colour)?;
        let (stream, mut completed) = (&mut this.stream, false);
        let field = interruptible(py, || {
            let field = stream.push_at(frame, dtype, time).map_err(|error| renamed(error, "frames", "frame"));
            completed = true;
            field
        });
        if !completed {
            // Stopped by Ctrl-C in the middle of a frame.
            this.stream.reset();
        }
        Ok(field?.map(FlowField::any))
    }

    /// Forgets every frame (H, W); the next one begins a new sequence, frame index 0.
    fn reset(slf: &Bound<'_, Self>) -> Outcome<()> {
        alone(slf)?.stream.reset();
        Ok(())
    }

    /// Frames that must come before the first field (a count, no unit).
    #[getter]
    fn frames_needed(&self) -> usize {
        self.stream.plan().estimator().frames_needed()
    }

    /// How many frames have been pushed since the start or the last reset (a count, no unit).
    #[getter]
    fn frames_pushed(&self) -> usize {
        self.stream.pushed()
    }

    /// The options as a dictionary, in the units of `estimate`.
    #[getter]
    fn options<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyDict>> {
        Ok((&self.arguments).into_pyobject(py)?)
    }

    fn __repr__(&self) -> String {
        let method = self.stream.plan().estimator().method().name();
        format!("FlowEstimator(method={method:?}, frames_pushed={})", self.frames_pushed())
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> Outcome<(Bound<'py, PyAny>, (Bound<'py, PyDict>, Bound<'py, PyDict>))> {
        let memory = PyDict::new(py);
        let (dtype, stream) = self.stream.stream();
        match stream {
            Stream::Empty => {}
            Stream::Single(stream) => save!(&memory, stream),
            Stream::Double(stream) => save!(&memory, stream),
        }
        memory.set_item("dtype", dtype)?;
        let restore = py.import("jacoflow._jacoflow")?.getattr("_restore_estimator")?;
        Ok((restore, (self.options(py)?, memory)))
    }
}

impl FlowEstimator {
    fn from_arguments(py: Python<'_>, arguments: Arguments) -> Outcome<Self> {
        let arguments = arguments.keep(py)?;
        Ok(Self { stream: arguments.stream(py, false)?, colour: arguments.colour(py)?, arguments })
    }
}

/// A stream of precision `$real` from what [`save`] wrote.
macro_rules! restored {
    ($real:ty, $plan:expr, $frames:expr, $times:expr, $pushed:expr, $fused:expr) => {{
        let fused = $fused.map(|saved| -> Outcome<_> {
            let (sites, state): (usize, PyReadonlyArray1<'_, $real>) = saved.extract()?;
            Ok((sites, state.as_slice()?.to_vec()))
        });
        let mut stream = FlowStream::<$real>::new($plan)?;
        stream.restore($frames.iter().map(AnyFrame::to_real).zip($times), $pushed, fused.transpose()?)?;
        stream
    }};
}

/// The inverse of `FlowEstimator.__reduce__`.
#[pyfunction(name = "_restore_estimator")]
pub fn restore_estimator(py: Python<'_>, options: Arguments, memory: &Bound<'_, PyDict>) -> Outcome<FlowEstimator> {
    let mut estimator = FlowEstimator::from_arguments(py, options)?;
    let Some(frames) = memory.get_item("frames")? else { return Ok(estimator) };
    let missing = || Error::argument("memory", "the entries frames, times, pushed and dtype", "fewer");
    let times: Vec<Option<f64>> = memory.get_item("times")?.ok_or_else(missing)?.extract()?;
    let pushed: usize = memory.get_item("pushed")?.ok_or_else(missing)?.extract()?;
    let dtype: String = memory.get_item("dtype")?.ok_or_else(missing)?.extract()?;
    let frames: Vec<AnyFrame> =
        frames.try_iter()?.map(|frame| arrays::frame("memory", &frame?, ColourRule::Refuse)).collect::<Outcome<_>>()?;
    let (plan, fused) = (estimator.stream.plan().clone(), memory.get_item("fused")?);
    let stream = if frames.iter().any(|frame| matches!(frame, AnyFrame::F64(_))) {
        Stream::Double(restored!(f64, plan, frames, times, pushed, fused))
    } else {
        Stream::Single(restored!(f32, plan, frames, times, pushed, fused))
    };
    estimator.stream.resume(options::known_dtype(&dtype)?, stream);
    Ok(estimator)
}
