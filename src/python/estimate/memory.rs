//! The few frames that an estimator needs, in the precision of the sequence.

use super::arguments::Plan;
use crate::error::Result;
use crate::flow::Estimator;
use crate::image::Preprocess;
use crate::python::field::Stored;
use crate::python::options;
use crate::simd::SimdReal;
use crate::types::{AnyFrame, FlowField, Frame};
use pyo3::prelude::*;
use std::collections::VecDeque;

/// Frames of one precision, prepared, oldest first.
#[derive(Debug)]
pub struct Ring<T> {
    pub frames: VecDeque<Frame<T>>,
    /// How many frames have been pushed in all.
    pub pushed: usize,
    /// Sample type of the first.
    pub dtype: &'static str,
}

impl<T: SimdReal> Ring<T> {
    fn new(dtype: &'static str) -> Self {
        Self { frames: VecDeque::new(), pushed: 0, dtype }
    }

    /// Takes the next frame; a field once there are enough. A frame that cannot be used is not kept.
    fn push(
        &mut self,
        estimator: &Estimator,
        preprocess: &Preprocess,
        frame: &AnyFrame,
    ) -> Result<Option<FlowField<T>>> {
        if let Some(first) = self.frames.front().filter(|first| first.size() != frame.size()) {
            let text = |(width, height): (usize, usize)| format!("{width} x {height}");
            let expected = format!("frames of one size (the first is {})", text(first.size()));
            return Err(crate::Error::argument("frames", expected, format!("one of {}", text(frame.size()))));
        }
        let needed = estimator.frames_needed();
        let frame = estimator.common().threads.install(|| preprocess.apply(frame.to_real::<T>()));
        self.frames.push_back(frame);
        if self.frames.len() > needed {
            self.frames.pop_front();
        }
        self.pushed += 1;
        if self.frames.len() < needed {
            return Ok(None);
        }
        let frames: Vec<_> = self.frames.iter().collect();
        let field = estimator.estimate(&frames, self.pushed - needed);
        if field.is_err() {
            self.frames.pop_back();
            self.pushed -= 1;
        }
        field.map(Some)
    }
}

/// The memory of a sequence whose precision is known from its first frame on.
#[derive(Debug)]
pub enum Memory {
    /// No frame yet.
    Empty,
    /// float32.
    Single(Ring<f32>),
    /// float64.
    Double(Ring<f64>),
}

/// A field of either precision.
pub enum AnyField {
    /// float32.
    Single(FlowField<f32>),
    /// float64.
    Double(FlowField<f64>),
}

impl Memory {
    /// Takes the next frame, detached from the interpreter.
    pub fn push(
        &mut self,
        py: Python<'_>,
        argument: &str,
        plan: &Plan,
        frame: &AnyFrame,
    ) -> PyResult<Option<AnyField>> {
        if matches!(self, Self::Empty) {
            *self = if plan.precision.is_double(frame) {
                Self::Double(Ring::new(frame.dtype()))
            } else {
                Self::Single(Ring::new(frame.dtype()))
            };
        }
        match self {
            Self::Empty => Ok(None),
            Self::Single(ring) => Ok(advance(py, argument, ring, plan, frame)?.map(AnyField::Single)),
            Self::Double(ring) => Ok(advance(py, argument, ring, plan, frame)?.map(AnyField::Double)),
        }
    }
}

fn advance<T: SimdReal + Stored>(
    py: Python<'_>,
    argument: &str,
    ring: &mut Ring<T>,
    plan: &Plan,
    frame: &AnyFrame,
) -> PyResult<Option<FlowField<T>>> {
    options::check_dtype(argument, ring.dtype, frame)?;
    Ok(py.detach(|| ring.push(&plan.estimator, &plan.preprocess, frame))?)
}
