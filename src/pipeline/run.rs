//! The loop over frames.

use super::{prefetch::Prefetch, sink::FieldSink, sink::Step, sink::end_all, sink::in_place, stage::Stage};
use crate::error::{Error, Result};
use crate::io::FrameSource;
use crate::parallel::Progress;
use crate::simd::SimdReal;
use crate::types::{AnyFrame, Status};
use std::collections::VecDeque;
use std::path::PathBuf;
use std::time::Instant;

/// Frame `k` of the run is frame `start + k * step` of the input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Numbering {
    /// Index of the first frame.
    pub start: usize,
    /// Distance between used frames.
    pub step: usize,
    /// Frames per second of the input (before `step`).
    pub rate: Option<f64>,
    /// Whether times that the source has for its frames replace those by `rate`.
    pub has_own_times: bool,
}

impl Default for Numbering {
    fn default() -> Self {
        Self { start: 0, step: 1, rate: None, has_own_times: true }
    }
}

impl Numbering {
    /// Index in the input of the `k`-th pushed frame.
    pub fn index(&self, k: usize) -> usize {
        self.start + k * self.step
    }
    /// Seconds between pushed frames.
    pub fn period(&self) -> Option<f64> {
        self.rate.map(|rate| self.step as f64 / rate)
    }
    /// Time of input frame `index`, seconds from input frame 0.
    pub fn time(&self, index: usize) -> Option<f64> {
        self.rate.map(|rate| index as f64 / rate)
    }
    /// As [`Numbering::time`], where the source says `own` of this frame.
    pub fn time_of(&self, index: usize, own: Option<f64>) -> Option<f64> {
        own.filter(|_| self.has_own_times).or_else(|| self.time(index))
    }
}

/// What a run did.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Summary {
    /// Frames read.
    pub frames: usize,
    /// Fields estimated and taken by every sink.
    pub fields: usize,
    /// SamplingGrid with a valid estimate.
    pub valid: u64,
    /// SamplingGrid in all.
    pub sites: u64,
    /// Restarts of a filter's pixel.
    pub repairs: usize,
    /// Files written.
    pub files: usize,
    /// The last of them, under the name that it really has: that of a stopped run differs.
    pub latest: Option<PathBuf>,
    /// Wall-clock seconds.
    pub seconds: f64,
}

impl Summary {
    /// Valid sites over all sites, 0 to 1 (0 without any site).
    pub fn valid_share(&self) -> f64 {
        if self.sites == 0 { 0.0 } else { self.valid as f64 / self.sites as f64 }
    }
}

/// A run: frames in, fields out.
pub struct Pipeline<T> {
    numbering: Numbering,
    stage: Box<dyn Stage<T>>,
    sinks: Vec<Box<FieldSink<T>>>,
    /// Times that the source has for the frames pushed last, the newest at the end.
    times: VecDeque<Option<f64>>,
    summary: Summary,
}

/// Frames between the one pushed and the one that its field belongs to, at most.
const MAX_DELAY: usize = 2;

impl<T: SimdReal> Pipeline<T> {
    /// A pipeline around `stage`, without sinks.
    pub fn new(stage: Box<dyn Stage<T>>) -> Self {
        Self {
            numbering: Numbering::default(),
            stage,
            sinks: Vec::new(),
            times: VecDeque::new(),
            summary: Summary::default(),
        }
    }

    /// Which frames of the input come.
    pub fn with_numbering(mut self, numbering: Numbering) -> Self {
        self.numbering = numbering;
        self
    }
    /// Further receivers of the results.
    pub fn with_sinks(mut self, sinks: impl IntoIterator<Item = Box<FieldSink<T>>>) -> Self {
        self.sinks.extend(sinks);
        self
    }

    /// What was done so far; valid after a failed or interrupted run too.
    pub fn summary(&self) -> Summary {
        self.summary.clone()
    }
    /// The stage, for its state after the run.
    pub fn stage(&self) -> &dyn Stage<T> {
        &*self.stage
    }

    /// Works through `source` and ends every sink, however the run ends.
    ///
    /// `progress` receives the number of frames read, at least once a frame and while waiting for one; its
    /// error stops the run, and what is complete then stays.
    ///
    /// # Errors
    /// Those of the source, the stage, the sinks and `progress`; [`Error::Argument`] when there are too few
    /// frames or one differs in size.
    pub fn run(&mut self, source: Box<dyn FrameSource>, progress: &dyn Progress) -> Result<()> {
        let start = Instant::now();
        let worked = self.work(source, progress);
        let result = end_all(worked, &mut self.sinks, |sink, ending| sink.finish(ending));
        (self.summary.files, self.summary.latest) = in_place(self.sinks.iter().map(|sink| sink.files()));
        self.summary.repairs = self.stage.repairs();
        self.summary.seconds = start.elapsed().as_secs_f64();
        result
    }

    fn work(&mut self, source: Box<dyn FrameSource>, progress: &dyn Progress) -> Result<()> {
        let total = source.len_hint().unwrap_or(0);
        let frames = Prefetch::start(source)?;
        let mut size = None;
        loop {
            let done = self.summary.frames;
            progress.step(done, total)?;
            let Some(frame) = frames.next(|| progress.step(done, total))? else { break };
            check_size(&mut size, frame.size(), self.numbering.index(done))?;
            self.summary.frames += 1;
            self.times.push_back(frames.last_time());
            if self.times.len() > MAX_DELAY + 1 {
                self.times.pop_front();
            }
            self.push(frame)?;
        }
        progress.step(self.summary.frames, total)?;
        let needed = self.stage.frames_needed();
        if self.summary.frames < needed {
            let wanted = format!("at least {needed} frames for this method");
            return Err(Error::argument("frames", wanted, self.summary.frames));
        }
        Ok(())
    }

    fn push(&mut self, frame: AnyFrame) -> Result<()> {
        let time = self.times.back().copied().flatten().filter(|_| self.numbering.has_own_times);
        let Some((mut field, frame)) = self.stage.push(frame, time)? else { return Ok(()) };
        let delay = self.summary.frames.saturating_sub(field.layout.frame_index + 1);
        let own = self.times.iter().rev().nth(delay).copied().flatten();
        field.layout.frame_index = self.numbering.index(field.layout.frame_index);
        let time = self.numbering.time_of(field.layout.frame_index, own);
        let step = Step { field: &field, frame: &frame, time };
        for sink in &mut self.sinks {
            sink.accept(&step)?;
        }
        self.summary.fields += 1;
        self.summary.sites += field.len() as u64;
        self.summary.valid += field.status.iter().filter(|status| Status::is_valid(**status)).count() as u64;
        Ok(())
    }
}

/// The first frame sets the size; every other one must have it.
pub(super) fn check_size(first: &mut Option<(usize, usize)>, size: (usize, usize), index: usize) -> Result<()> {
    let (width, height) = *first.get_or_insert(size);
    if size == (width, height) {
        return Ok(());
    }
    let got = format!("{} x {} in frame {index}", size.0, size.1);
    Err(Error::argument("frames", format!("one size, {width} x {height} as in the first frame"), got))
}
