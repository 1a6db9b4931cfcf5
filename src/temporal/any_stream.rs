//! A stream of frames in the precision that its first frame decides.

use super::{FlowStream, StreamPlan};
use crate::error::Result;
use crate::types::{AnyField, AnyFrame, Precision, expect_dtype};

/// A [`FlowStream`] whose precision and sample type are those of its first frame.
#[derive(Debug)]
pub struct AnyFlowStream {
    plan: StreamPlan,
    precision: Precision,
    /// Sample type of the first frame.
    dtype: Option<&'static str>,
    stream: Stream,
}

/// The stream in the precision that the first frame has decided.
#[derive(Debug)]
pub enum Stream {
    /// Before the first frame.
    Empty,
    /// float32.
    Single(FlowStream<f32>),
    /// float64.
    Double(FlowStream<f64>),
}

impl AnyFlowStream {
    /// A stream without frames.
    pub fn new(plan: StreamPlan, precision: Precision) -> Self {
        Self { plan, precision, dtype: None, stream: Stream::Empty }
    }

    /// As [`FlowStream::push_at`]. `dtype` is the type that the samples were given in, which is not that of
    /// the frame where a mask turned integers into floats.
    ///
    /// # Errors
    /// Also [`Error::Type`](crate::error::Error::Type) naming `frames` for another `dtype` than that of the
    /// first frame.
    pub fn push_at(&mut self, frame: AnyFrame, dtype: &'static str, time: Option<f64>) -> Result<Option<AnyField>> {
        expect_dtype("frames", dtype, self.dtype.get_or_insert(dtype))?;
        if matches!(self.stream, Stream::Empty) {
            let plan = self.plan.clone();
            self.stream = if self.precision.is_double(dtype) {
                Stream::Double(FlowStream::new(plan)?)
            } else {
                Stream::Single(FlowStream::new(plan)?)
            };
        }
        match &mut self.stream {
            Stream::Empty => Ok(None),
            Stream::Single(stream) => Ok(stream.push_at(frame, time)?.map(AnyField::Single)),
            Stream::Double(stream) => Ok(stream.push_at(frame, time)?.map(AnyField::Double)),
        }
    }

    /// As [`FlowStream::first_step`].
    ///
    /// # Errors
    /// Those of the estimator.
    pub fn first_step(&self) -> Result<Option<AnyField>> {
        match &self.stream {
            Stream::Empty => Ok(None),
            Stream::Single(stream) => Ok(stream.first_step()?.map(AnyField::Single)),
            Stream::Double(stream) => Ok(stream.first_step()?.map(AnyField::Double)),
        }
    }

    /// Forgets every frame.
    pub fn reset(&mut self) {
        (self.dtype, self.stream) = (None, Stream::Empty);
    }

    /// Replaces the stream by one whose first frame had samples of type `dtype`.
    pub fn resume(&mut self, dtype: &'static str, stream: Stream) {
        (self.dtype, self.stream) = (Some(dtype), stream);
    }

    /// What the frames pass through.
    pub fn plan(&self) -> &StreamPlan {
        &self.plan
    }

    /// The working precision that was chosen.
    pub fn precision(&self) -> Precision {
        self.precision
    }

    /// The stream, and the sample type of its first frame.
    pub fn stream(&self) -> (Option<&'static str>, &Stream) {
        (self.dtype, &self.stream)
    }

    /// Number of frames pushed since the start or the last reset.
    pub fn pushed(&self) -> usize {
        match &self.stream {
            Stream::Empty => 0,
            Stream::Single(stream) => stream.pushed(),
            Stream::Double(stream) => stream.pushed(),
        }
    }
}
