//! Flow from a stream of frames: preparation, frame ring, estimator, fusion of steady motion.

use super::{RecursiveFusion, RecursiveOptions};
use crate::buffer_pool;
use crate::error::{Error, Result};
use crate::flow::{Estimator, Method};
use crate::image::Preprocess;
use crate::math::Real;
use crate::simd::{SimdReal, same_mut};
use crate::types::{AnyFrame, FlowField, Frame, Interval, Mask, Sample, Status, Units};
use std::collections::VecDeque;
use std::sync::Arc;

/// Relative difference of the two steps of a triple above which its motion is that of the second step alone:
/// a lost frame doubles a step, clocks of cameras jitter by some per cent.
const UNEVEN_STEPS: f64 = 0.2;

/// What some containers of video (Matroska, WebM) round times to, s.
const TICK: f64 = 1e-3;

/// What the frames of a stream pass through, checked.
#[derive(Debug, Clone)]
pub struct StreamPlan {
    estimator: Arc<Estimator>,
    /// Estimates the step to the next frame without the frame before, where the estimator takes three.
    pair_estimator: Option<Arc<Estimator>>,
    /// Whether frames come in pairs: no field joins one to the next.
    is_double_frame: bool,
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
        let pair = estimator.method().as_pair().map(|method| Estimator::new(method, estimator.options().clone()));
        let pair_estimator = pair.transpose()?.map(Arc::new);
        Ok(Self { estimator: Arc::new(estimator), pair_estimator, is_double_frame: false, preprocess, recursive })
    }

    /// For frames that come in pairs, 0 and 1, 2 and 3, ...: a field for each pair.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `pairs` for an estimator of three frames or estimates that are fused.
    pub fn of_pairs(self) -> Result<Self> {
        let needed = self.estimator.frames_needed();
        if needed != 2 {
            let expected = "a method that takes two frames (time_scheme \"pair\")";
            return Err(Error::argument("pairs", expected, format!("one of {needed} frames")));
        }
        if self.recursive.is_some() {
            return Err(Error::argument("pairs", "no fusion over time", "temporal \"recursive\""));
        }
        Ok(Self { is_double_frame: true, ..self })
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
    /// Their times, s, where they are known.
    times: VecDeque<Option<f64>>,
    pushed: usize,
}

impl<T: SimdReal> FlowStream<T> {
    /// A stream without frames.
    pub fn new(plan: StreamPlan) -> Result<Self> {
        let fusion = plan.recursive.map(|options| RecursiveFusion::new(&plan.estimator, options)).transpose()?;
        Ok(Self { plan, fusion, frames: VecDeque::new(), times: VecDeque::new(), pushed: 0 })
    }

    /// Takes the next frame; returns a field once there are enough. Its `frame_index` counts frames from 0.
    ///
    /// # Errors
    /// As [`push_at`](Self::push_at).
    pub fn push(&mut self, frame: AnyFrame) -> Result<Option<FlowField<T>>> {
        self.push_at(frame, None)
    }

    /// As [`push`](Self::push), for a frame taken at `time`, s: the field's frame period is that of its own
    /// frames. Where the steps of a triple differ, the step to the next frame is estimated from its two
    /// frames.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `frames` for a frame of another size, `time` for one not after that of the
    /// frame before, and those of the estimator; the frame is then not kept.
    pub fn push_at(&mut self, frame: AnyFrame, time: Option<f64>) -> Result<Option<FlowField<T>>> {
        self.check_time(time)?;
        if let Some(first) = self.frames.front().filter(|first| first.size() != frame.size()) {
            let text = |(width, height): (usize, usize)| format!("{width} x {height}");
            let expected = format!("frames of one size (the first is {})", text(first.size()));
            return Err(Error::argument("frames", expected, format!("one of {}", text(frame.size()))));
        }
        let StreamPlan { estimator, preprocess, .. } = &self.plan;
        let needed = estimator.frames_needed();
        if self.plan.is_double_frame && self.frames.len() == needed {
            self.frames.drain(..).for_each(recycle);
            self.times.clear();
        }
        let frame = estimator.options().threads.install(|| Ok(preprocess.apply(into_real(frame)?)))?;
        self.frames.push_back(Arc::new(frame));
        self.times.push_back(time);
        if self.frames.len() > needed
            && let Some(oldest) = self.frames.pop_front()
        {
            recycle(oldest);
            self.times.pop_front();
        }
        self.pushed += 1;
        if self.frames.len() < needed {
            return Ok(None);
        }
        let field = self.estimate();
        if field.is_err() {
            self.frames.pop_back();
            self.times.pop_back();
            self.pushed -= 1;
        }
        field.map(Some)
    }

    fn check_time(&self, time: Option<f64>) -> Result<()> {
        let refuse = |expected: String| {
            let got = time.map_or_else(|| "none".to_string(), |time| format!("{time} s"));
            Err(Error::argument("time", expected, got))
        };
        match (self.times.back(), time) {
            (_, Some(time)) if !time.is_finite() => refuse("a finite time, s".into()),
            (Some(Some(last)), Some(time)) if time <= *last => {
                refuse(format!("a time after {last} s, that of the last frame"))
            }
            (Some(Some(_)), None) => refuse("a time for every frame, as the last one had".into()),
            (Some(None), Some(_)) => refuse("no time, as the last frame had none".into()),
            _ => Ok(()),
        }
    }

    /// The step from the first frame of the stream to the second, once both have come and no more, where the
    /// estimator takes three frames: there is no frame before. `None` for other methods and streams.
    ///
    /// # Errors
    /// Those of the estimator.
    pub fn first_step(&self) -> Result<Option<FlowField<T>>> {
        let is_start = self.pushed == 2 && self.frames.len() == 2 && self.fusion.is_none();
        let Some(pair) = self.plan.pair_estimator.as_ref().filter(|_| is_start) else { return Ok(None) };
        let mut field = pair.estimate(&[&*self.frames[0], &*self.frames[1]], 0)?;
        self.set_period(&mut field, 0);
        Ok(Some(field))
    }

    /// Seconds from frame `k` of the ring to the next: the nominal ones where times differ by rounding.
    fn step(&self, k: usize) -> Option<f64> {
        let times = [(*self.times.get(k)?)?, (*self.times.get(k + 1)?)?];
        let step = times[1] - times[0];
        let is_rounded = times.iter().all(|time| ((time / TICK).round() * TICK - time).abs() < 1e-3 * TICK);
        let nominal = self.plan.estimator.options().units.frame_period.filter(|_| is_rounded);
        Some(nominal.filter(|period| (step - period).abs() < TICK.min(0.5 * period)).unwrap_or(step))
    }

    /// Gives a field whose flow begins at frame `k` of the ring the period of its own frames.
    fn set_period(&self, field: &mut FlowField<T>, k: usize) {
        let steps = self.times.len().saturating_sub(1);
        let mean = || Some((0..steps).map(|k| self.step(k)).sum::<Option<f64>>()? / steps.max(1) as f64);
        let period = match field.layout.interval {
            Interval::Forward => self.step(k),
            // Backward differences at the newest frame.
            Interval::Instant if k > 0 && k == steps => self.step(k - 1),
            _ => mean(),
        };
        if period.is_some() {
            field.convert(Units { frame_period: period, ..field.layout.units.clone() });
        }
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

    /// Their times, s, oldest first.
    pub fn times(&self) -> impl Iterator<Item = Option<f64>> {
        self.times.iter().copied()
    }

    /// Number of sites and state of the fusion over time, if there is one.
    pub fn fused(&self) -> Option<(usize, &[T])> {
        self.fusion.as_ref().map(RecursiveFusion::state)
    }

    /// Replaces the state by that of another stream with the same plan: its [`frames`](Self::frames) with
    /// their
    /// [`times`](Self::times), [`pushed`](Self::pushed) and [`fused`](Self::fused).
    ///
    /// # Errors
    /// [`Error::Argument`] naming `state` where the fusion's numbers do not fit its number of sites.
    pub fn restore(
        &mut self,
        frames: impl IntoIterator<Item = (Frame<T>, Option<f64>)>,
        pushed: usize,
        fused: Option<(usize, Vec<T>)>,
    ) -> Result<()> {
        (self.frames, self.times) = frames.into_iter().map(|(frame, time)| (Arc::new(frame), time)).unzip();
        self.pushed = pushed;
        match (&mut self.fusion, fused) {
            (Some(fusion), Some((sites, state))) => fusion.restore(sites, state),
            _ => Ok(()),
        }
    }

    fn estimate(&mut self) -> Result<FlowField<T>> {
        let frames: Vec<&Frame<T>> = self.frames.iter().map(AsRef::as_ref).collect();
        let (first, reference) = (self.pushed - frames.len(), self.plan.estimator.reference_frame());
        let is_uneven = match (self.step(0), self.step(1)) {
            (Some(before), Some(after)) => (before - after).abs() > UNEVEN_STEPS * after,
            _ => false,
        };
        let pair = self.plan.pair_estimator.as_ref();
        let mask = self.plan.estimator.options().mask.as_ref();
        let mut field = match pair.filter(|_| is_uneven || lacks_most(&frames, mask)) {
            Some(pair) => estimate_pooled(pair, &frames[reference..], first + reference)?,
            None => estimate_pooled(&self.plan.estimator, &frames, first)?,
        };
        self.set_period(&mut field, reference);
        if let Some(fusion) = &mut self.fusion {
            fusion.fuse(&mut field)?;
            field.systematic = None;
        }
        Ok(field)
    }
}

/// Whether the first of some frames lacks most of the pixels that all others show: it is as good as lost.
fn lacks_most<T: Real>(frames: &[&Frame<T>], mask: Option<&Mask>) -> bool {
    let [first, others @ ..] = frames else { return false };
    // Without a short circuit, so that the compiler uses lanes.
    if first.data().iter().fold(true, |so_far, value| so_far & value.finite()) {
        return false;
    }
    let is_shown = |frame: &Frame<T>, n: usize| frame.data()[n].finite();
    let allowed = |&n: &usize| mask.and_then(|mask| mask.data().get(n)) != Some(&false);
    let shown = (0..first.data().len()).filter(allowed).filter(|&n| others.iter().all(|frame| is_shown(frame, n)));
    let (shown, by_first) = shown.fold((0, 0), |(all, own), n| (all + 1, own + usize::from(is_shown(first, n))));
    2 * by_first < shown.max(1)
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
