//! Flow from a stream of frames: preparation, frame ring, estimator, fusion of steady motion.

use super::{RecursiveFusion, RecursiveOptions};
use crate::buffer_pool;
use crate::error::{Error, Result};
use crate::flow::{Estimator, Method};
use crate::image::Preprocess;
use crate::math::Real;
use crate::simd::{SimdReal, same_mut};
use crate::types::{AnyField, AnyFrame, FlowField, Frame, Precision, Sample, Status};
use std::collections::VecDeque;
use std::sync::Arc;

/// What the frames of a stream pass through, checked.
#[derive(Debug, Clone)]
pub struct StreamPlan {
    estimator: Arc<Estimator>,
    preprocess: Preprocess,
    recursive: Option<RecursiveOptions>,
}

impl StreamPlan {
    /// Frames pass `preprocess` and `estimator`; with `recursive` the estimates are fused over time.
    ///
    /// A method that smooths frames itself gets them unsmoothed, because it reads their noise first.
    pub fn new(estimator: Estimator, mut preprocess: Preprocess, recursive: Option<RecursiveOptions>) -> Result<Self> {
        if estimator.method().info().smooths_frames {
            preprocess.smooth = None;
        }
        if let Some(options) = recursive {
            RecursiveFusion::<f32>::new(&estimator, options)?;
        }
        Ok(Self { estimator: Arc::new(estimator), preprocess, recursive })
    }

    /// The estimator.
    pub fn estimator(&self) -> &Estimator {
        &self.estimator
    }
}

/// Estimates flow from frames that come one by one; keeps the few frames that the estimator needs.
#[derive(Debug)]
pub struct FlowStream<T: Real> {
    plan: StreamPlan,
    fusion: Option<RecursiveFusion<T>>,
    /// Prepared frames, oldest first.
    frames: VecDeque<Arc<Frame<T>>>,
    pushed: usize,
}

impl<T: SimdReal> FlowStream<T> {
    /// A stream without frames.
    pub fn new(plan: StreamPlan) -> Result<Self> {
        let fusion = plan.recursive.map(|options| RecursiveFusion::new(&plan.estimator, options)).transpose()?;
        Ok(Self { plan, fusion, frames: VecDeque::new(), pushed: 0 })
    }

    /// Takes the next frame; returns a field once there are enough. Its `frame_index` counts frames from 0.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `frames` for a frame of another size, and those of the estimator; the frame
    /// is then not kept.
    pub fn push(&mut self, frame: AnyFrame) -> Result<Option<FlowField<T>>> {
        if let Some(first) = self.frames.front().filter(|first| first.size() != frame.size()) {
            let text = |(width, height): (usize, usize)| format!("{width} x {height}");
            let expected = format!("frames of one size (the first is {})", text(first.size()));
            return Err(Error::argument("frames", expected, format!("one of {}", text(frame.size()))));
        }
        let StreamPlan { estimator, preprocess, .. } = &self.plan;
        let needed = estimator.frames_needed();
        let frame = estimator.options().threads.install(|| Ok(preprocess.apply(into_real(frame)?)))?;
        self.frames.push_back(Arc::new(frame));
        if self.frames.len() > needed
            && let Some(oldest) = self.frames.pop_front()
        {
            recycle(oldest);
        }
        self.pushed += 1;
        if self.frames.len() < needed {
            return Ok(None);
        }
        let field = self.estimate();
        if field.is_err() {
            self.frames.pop_back();
            self.pushed -= 1;
        }
        field.map(Some)
    }

    /// What the frames pass through.
    pub fn plan(&self) -> &StreamPlan {
        &self.plan
    }

    /// Number of frames pushed.
    pub fn pushed(&self) -> usize {
        self.pushed
    }

    /// The prepared frame that the latest field belongs to.
    pub fn reference_frame(&self) -> Option<&Arc<Frame<T>>> {
        self.frames.get(self.plan.estimator.reference_frame())
    }

    /// The prepared frames that the next field may need, oldest first.
    pub fn frames(&self) -> impl Iterator<Item = &Frame<T>> {
        self.frames.iter().map(AsRef::as_ref)
    }

    /// Number of sites and state of the fusion over time, if there is one.
    pub fn fused(&self) -> Option<(usize, &[T])> {
        self.fusion.as_ref().map(RecursiveFusion::state)
    }

    /// Replaces the state by that of another stream with the same plan: its [`frames`](Self::frames),
    /// [`pushed`](Self::pushed) and [`fused`](Self::fused).
    ///
    /// # Errors
    /// [`Error::Argument`] naming `state` where the fusion's numbers do not fit its number of sites.
    pub fn restore(
        &mut self,
        frames: impl IntoIterator<Item = Frame<T>>,
        pushed: usize,
        fused: Option<(usize, Vec<T>)>,
    ) -> Result<()> {
        self.frames = frames.into_iter().map(Arc::new).collect();
        self.pushed = pushed;
        match (&mut self.fusion, fused) {
            (Some(fusion), Some((sites, state))) => fusion.restore(sites, state),
            _ => Ok(()),
        }
    }

    fn estimate(&mut self) -> Result<FlowField<T>> {
        let frames: Vec<&Frame<T>> = self.frames.iter().map(AsRef::as_ref).collect();
        let mut field = estimate_pooled(&self.plan.estimator, &frames, self.pushed - frames.len())?;
        if let Some(fusion) = &mut self.fusion {
            fusion.fuse(&mut field)?;
            field.systematic = None;
        }
        Ok(field)
    }
}

impl<T: Real> Drop for FlowStream<T> {
    fn drop(&mut self) {
        self.frames.drain(..).for_each(recycle);
    }
}

/// Returns the memory of a frame that nobody else holds to the buffer pool.
fn recycle<T: Real>(frame: Arc<Frame<T>>) {
    if let Some(frame) = Arc::into_inner(frame) {
        buffer_pool::give(frame.into_data());
    }
}

/// The frame in working precision; moved where it has that precision already.
fn into_real<T: Real>(frame: AnyFrame) -> Result<Frame<T>> {
    match frame {
        AnyFrame::U8(frame) => convert(frame),
        AnyFrame::U16(frame) => convert(frame),
        AnyFrame::F32(frame) => convert(frame),
        AnyFrame::F64(frame) => convert(frame),
    }
}

fn convert<S: Sample, T: Real>(mut frame: Frame<S>) -> Result<Frame<T>> {
    if let Some(own) = same_mut::<_, Frame<T>>(&mut frame) {
        return Ok(std::mem::take(own));
    }
    let (width, height) = frame.size();
    let mut samples = buffer_pool::take_or(width * height, T::default());
    for (to, from) in samples.iter_mut().zip(frame.data()) {
        *to = from.to_real();
    }
    buffer_pool::give(frame.into_data());
    Frame::new(width, height, samples)
}

/// As [`Estimator::estimate`], in pooled memory where the pool has some that fits.
fn estimate_pooled<T: SimdReal>(
    estimator: &Estimator,
    frames: &[&Frame<T>],
    first_index: usize,
) -> Result<FlowField<T>> {
    let common = estimator.options();
    let frame_size = match frames.first() {
        // Other methods take so long that a new field does not matter.
        Some(frame) if matches!(estimator.method(), Method::Instantaneous(_) | Method::CoarseToFine(_)) => frame.size(),
        _ => return estimator.estimate(frames, first_index),
    };
    let layout = estimator.layout(frame_size, first_index);
    let (width, height) = layout.sites.shape(frame_size)?;
    let (n, p) = (width * height, layout.parameters.len());
    let Some(motion) = buffer_pool::take::<T>(p * n) else { return estimator.estimate(frames, first_index) };
    let status = buffer_pool::take::<u8>(n).map(|codes| codes.into_iter().map(|_| Status::Border).collect());
    let mut field = FlowField {
        layout,
        width,
        height,
        motion,
        covariance: common.covariance.then(|| buffer_pool::take_or(p * (p + 1) / 2 * n, T::nan())),
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

    /// As [`FlowStream::push`].
    ///
    /// # Errors
    /// Also [`Error::Type`] naming `frames` for another sample type than that of the first frame.
    pub fn push(&mut self, frame: AnyFrame) -> Result<Option<AnyField>> {
        let dtype = frame.dtype();
        let expected = *self.dtype.get_or_insert(dtype);
        if dtype != expected {
            let expected = format!("{expected} like the first frame");
            return Err(Error::Type { argument: "frames", expected, got: dtype.into() });
        }
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
            Stream::Single(stream) => Ok(stream.push(frame)?.map(AnyField::Single)),
            Stream::Double(stream) => Ok(stream.push(frame)?.map(AnyField::Double)),
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
