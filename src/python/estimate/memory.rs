//! The few frames that an estimator needs, in the precision of the sequence.

use super::arguments::Plan;
use crate::error::Result;
use crate::flow::{Estimator, Method};
use crate::math::Real;
use crate::python::field::Stored;
use crate::python::{options, spare};
use crate::simd::{SimdReal, same_mut};
use crate::temporal::RecursiveFusion;
use crate::types::{AnyFrame, FlowField, Frame, Sample, Status};
use pyo3::prelude::*;
use std::collections::VecDeque;

/// Frames of one precision, prepared, oldest first.
#[derive(Debug)]
pub struct Ring<T: Real> {
    pub frames: VecDeque<Frame<T>>,
    /// How many frames have been pushed in all.
    pub pushed: usize,
    /// Sample type of the first.
    pub dtype: &'static str,
    /// What the estimates before tell, where they are fused.
    pub fusion: Option<RecursiveFusion<T>>,
}

impl<T: SimdReal> Ring<T> {
    fn new(dtype: &'static str) -> Self {
        Self { frames: VecDeque::new(), pushed: 0, dtype, fusion: None }
    }

    /// Takes the next frame; a field once there are enough. A frame that cannot be used is not kept.
    fn push(&mut self, plan: &Plan, frame: AnyFrame) -> Result<Option<FlowField<T>>> {
        let Plan { estimator, preprocess, .. } = plan;
        if let Some(first) = self.frames.front().filter(|first| first.size() != frame.size()) {
            let text = |(width, height): (usize, usize)| format!("{width} x {height}");
            let expected = format!("frames of one size (the first is {})", text(first.size()));
            return Err(crate::Error::argument("frames", expected, format!("one of {}", text(frame.size()))));
        }
        let needed = estimator.frames_needed();
        let frame = estimator.options().threads.install(|| Ok(preprocess.apply(real(frame)?)))?;
        self.frames.push_back(frame);
        if self.frames.len() > needed
            && let Some(oldest) = self.frames.pop_front()
        {
            spare::give(oldest.into_data());
        }
        self.pushed += 1;
        if self.frames.len() < needed {
            return Ok(None);
        }
        let frames: Vec<_> = self.frames.iter().collect();
        let first = self.pushed - needed;
        let field = estimate(estimator, &frames, first).and_then(|field| fused(&mut self.fusion, plan, field));
        if field.is_err() {
            self.frames.pop_back();
            self.pushed -= 1;
        }
        field.map(Some)
    }
}

/// The field with what the fields before it tell, where that is wanted.
fn fused<T: SimdReal>(
    fusion: &mut Option<RecursiveFusion<T>>,
    plan: &Plan,
    mut field: FlowField<T>,
) -> Result<FlowField<T>> {
    if let Some(options) = plan.recursive {
        let fusion = match fusion {
            Some(fusion) => fusion,
            empty => empty.insert(RecursiveFusion::new(&plan.estimator, options)?),
        };
        fusion.fuse(&mut field)?;
        field.systematic = None;
    }
    Ok(field)
}

impl<T: Real> Drop for Ring<T> {
    fn drop(&mut self) {
        self.frames.drain(..).for_each(|frame| spare::give(frame.into_data()));
    }
}

/// The frame in working precision: itself where it is that already.
fn real<T: Real>(frame: AnyFrame) -> Result<Frame<T>> {
    match frame {
        AnyFrame::U8(frame) => converted(frame),
        AnyFrame::U16(frame) => converted(frame),
        AnyFrame::F32(frame) => converted(frame),
        AnyFrame::F64(frame) => converted(frame),
    }
}

fn converted<S: Sample, T: Real>(mut frame: Frame<S>) -> Result<Frame<T>> {
    if let Some(own) = same_mut::<_, Frame<T>>(&mut frame) {
        return Ok(std::mem::replace(own, Frame::new(0, 0, Vec::new())?));
    }
    let (width, height) = frame.size();
    let mut samples = spare::take(width * height).unwrap_or_else(|| vec![T::default(); width * height]);
    for (to, from) in samples.iter_mut().zip(frame.data()) {
        *to = from.to_real();
    }
    spare::give(frame.into_data());
    Frame::new(width, height, samples)
}

/// As [`Estimator::estimate`], in the memory of an earlier field where there is one that fits.
fn estimate<T: SimdReal>(estimator: &Estimator, frames: &[&Frame<T>], first_index: usize) -> Result<FlowField<T>> {
    let common = estimator.options();
    let frame_size = match frames.first() {
        // Other methods take long enough for a fresh field not to matter.
        Some(frame) if matches!(estimator.method(), Method::Instantaneous(_) | Method::CoarseToFine(_)) => frame.size(),
        _ => return estimator.estimate(frames, first_index),
    };
    let layout = estimator.layout(frame_size, first_index);
    let (width, height) = layout.sites.shape(frame_size)?;
    let (n, p) = (width * height, layout.parameters.len());
    let Some(motion) = spare::take::<T>(p * n) else { return estimator.estimate(frames, first_index) };
    let status = spare::take::<u8>(n).map(|codes| codes.into_iter().map(|_| Status::Border).collect());
    let covariance = || spare::take::<T>(p * (p + 1) / 2 * n).unwrap_or_else(|| vec![T::nan(); p * (p + 1) / 2 * n]);
    let mut field = FlowField {
        layout,
        width,
        height,
        motion,
        covariance: common.covariance.then(covariance),
        systematic: None,
        status: status.unwrap_or_else(|| vec![Status::Border; n]),
        residual: None,
        rank: None,
        condition: None,
        window: None,
    };
    estimator.estimate_into(frames, first_index, &mut field)?;
    Ok(field)
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
    pub fn push(&mut self, py: Python<'_>, argument: &str, plan: &Plan, frame: AnyFrame) -> PyResult<Option<AnyField>> {
        if matches!(self, Self::Empty) {
            *self = if plan.precision.is_double(&frame) {
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
    frame: AnyFrame,
) -> PyResult<Option<FlowField<T>>> {
    options::check_dtype(argument, ring.dtype, &frame)?;
    Ok(py.detach(|| ring.push(plan, frame))?)
}
