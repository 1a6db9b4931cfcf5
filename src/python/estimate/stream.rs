//! `FlowEstimator`: flow from frames that come one by one.

use super::arguments::{Arguments, Plan, estimator_options};
use super::memory::{AnyField, Memory, Ring};
use crate::error::Error;
use crate::python::arrays;
use crate::python::field::FlowField;
use crate::python::keywords::{constructor, with_common};
use crate::python::options::{self, Integer, Object, Region};
use crate::simd::SimdReal;
use crate::temporal::RecursiveFusion;
use crate::types::{AnyFrame, Frame};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::collections::VecDeque;

/// Flow from a stream: frames are pushed one by one, memory stays bounded.
///
/// The options are those of `estimate`; see there for what they mean and their units. A field (H, W) comes as
/// soon as three frames have (two with time_scheme="pair"). With temporal="recursive" each field holds what
/// all frames so far tell. Pickles in mid-stream.
#[pyclass(module = "jacoflow")]
pub struct FlowEstimator {
    arguments: Arguments,
    plan: Plan,
    memory: Memory,
}

estimator_options!(constructor [FlowEstimator from Arguments]);

#[pymethods]
impl FlowEstimator {
    /// Takes the next frame (H, W), in any grey unit; returns a FlowField (px/frame) once enough frames have
    /// come, before that None.
    ///
    /// A frame that raises an error (ValueError for another size, TypeError for another dtype) is not kept.
    fn push(&mut self, frame: &Bound<'_, PyAny>) -> PyResult<Option<FlowField>> {
        let py = frame.py();
        let frame = arrays::frame("frame", frame, self.plan.colour)?;
        Ok(self.memory.push(py, "frame", &self.plan, frame)?.map(AnyField::single))
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
        (&self.arguments).into_pyobject(py)
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

fn save<T: numpy::Element + SimdReal>(memory: &Bound<'_, PyDict>, ring: &Ring<T>) -> PyResult<()> {
    let py = memory.py();
    let frames = ring.frames.iter().map(|frame| arrays::from_frame(py, frame.clone()));
    memory.set_item("frames", PyList::new(py, frames.collect::<PyResult<Vec<_>>>()?)?)?;
    if let Some((sites, state)) = ring.fusion.as_ref().map(RecursiveFusion::state) {
        memory.set_item("fused", (sites, arrays::owned(py, &[state.len()], state.to_vec())?))?;
    }
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
    let fused = memory.get_item("fused")?;
    estimator.memory = if double.is_empty() {
        let fusion = restore_fusion(&estimator.plan, fused)?;
        Memory::Single(Ring { frames: single, pushed, dtype, fusion })
    } else {
        let fusion = restore_fusion(&estimator.plan, fused)?;
        Memory::Double(Ring { frames: double, pushed, dtype, fusion })
    };
    Ok(estimator)
}

/// What the estimates before told, where they are fused.
fn restore_fusion<T: numpy::Element + SimdReal>(
    plan: &Plan,
    saved: Option<Bound<'_, PyAny>>,
) -> PyResult<Option<RecursiveFusion<T>>> {
    let (Some(options), Some(saved)) = (plan.recursive, saved) else { return Ok(None) };
    let (sites, state): (usize, PyReadonlyArray1<'_, T>) = saved.extract()?;
    let mut fusion = RecursiveFusion::new(&plan.estimator, options)?;
    fusion.restore(sites, state.as_slice()?.to_vec())?;
    Ok(Some(fusion))
}
