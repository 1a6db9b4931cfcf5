//! From frames to tracks: source, preparation, grey levels, trackers, sinks, one frame at a time.

mod overlay;
mod rows;

pub use overlay::{Overlays, PATH_LENGTH};
pub(super) use rows::{Row, RowWriter};
pub use rows::{TrackFormat, TrackRows};

use super::{prefetch::Prefetch, run::Numbering, run::check_size, sink::Sink, sink::end_all};
use crate::error::{Error, Result};
use crate::image::Preprocess;
use crate::io::FrameSource;
use crate::parallel::{self, Progress, Threads};
use crate::track::{GreyLevels, Tracker};
use crate::types::{AnyFrame, Frame, TrackState, TrackStatus};
use std::path::PathBuf;
use std::time::Instant;

/// What every tracker says of one frame.
#[derive(Debug)]
pub struct TrackStep<'a> {
    /// Index of the frame in the input.
    pub frame_index: usize,
    /// Its time, s from the first frame of the input; `None` where the frame rate is not known.
    pub time: Option<f64>,
    /// The frame as it came.
    pub frame: &'a AnyFrame,
    /// The targets; number `k + 1` is at `k`.
    pub states: &'a [TrackState],
}

/// A receiver of tracks.
pub type TrackSink = dyn for<'a> Sink<TrackStep<'a>>;

/// What a run begins with: no file is begun for targets that cannot be followed.
pub struct Begun {
    /// One tracker a target.
    pub trackers: Vec<Box<dyn Tracker>>,
    /// The receivers of the tracks.
    pub sinks: Vec<Box<TrackSink>>,
}

/// Makes trackers and sinks from the first frame in grey levels.
pub type Begin<'a> = Box<dyn FnOnce(&Frame<f64>) -> Result<Begun> + 'a>;

/// How one target fared.
#[derive(Debug, Clone, PartialEq)]
pub struct TargetSummary {
    /// Its number, from 1 unless the input gives one.
    pub number: u64,
    /// Frames with each status, in the order of [`TrackStatus::ALL`].
    pub counts: [usize; TrackStatus::ALL.len()],
    /// The target at the last frame.
    pub last: TrackState,
}

/// What a run did.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TrackSummary {
    /// Frames read and taken by every sink.
    pub frames: usize,
    /// The targets; empty before the first frame.
    pub targets: Vec<TargetSummary>,
    /// Files written.
    pub files: usize,
    /// The last of them, under the name that it really has.
    pub latest: Option<PathBuf>,
    /// The last of each sink, in the order of the sinks.
    pub latest_of_sinks: Vec<Option<PathBuf>>,
    /// Wall-clock seconds.
    pub seconds: f64,
}

/// A run: frames in, tracks out. Targets are followed independently of each other, in parallel; the result
/// does not depend on the number of threads.
#[derive(Default)]
pub struct TrackRun {
    preprocess: Preprocess,
    threads: Threads,
    numbering: Numbering,
    sinks: Vec<Box<TrackSink>>,
    summary: TrackSummary,
}

impl TrackRun {
    /// What is done to each frame first, on its own scale of brightness.
    pub fn with_preprocess(mut self, preprocess: Preprocess) -> Self {
        self.preprocess = preprocess;
        self
    }
    /// Threads of the preparation and of the targets.
    pub fn with_threads(mut self, threads: Threads) -> Self {
        self.threads = threads;
        self
    }
    /// Which frames of the input come.
    pub fn with_numbering(mut self, numbering: Numbering) -> Self {
        self.numbering = numbering;
        self
    }

    /// What was done so far; valid after a failed or interrupted run too.
    pub fn summary(&self) -> TrackSummary {
        self.summary.clone()
    }

    /// Works through `source` and ends every sink, however the run ends. `begin` makes trackers and sinks;
    /// the trackers' state at the first frame is the first row.
    ///
    /// `progress` receives the number of frames read, at least once a frame and while waiting for one; its
    /// error stops the run, and what is complete then stays.
    ///
    /// # Errors
    /// Those of the source, of `begin`, the trackers, the sinks and `progress`; [`Error::Argument`] named
    /// `frames` for fewer than two frames or one of another size.
    pub fn run(&mut self, source: Box<dyn FrameSource>, begin: Begin<'_>, progress: &dyn Progress) -> Result<()> {
        let start = Instant::now();
        let worked = self.work(source, begin, progress);
        let result = end_all(worked, &mut self.sinks, |sink, ending| sink.finish(ending));
        self.summary.note_files(self.sinks.iter().map(|sink| sink.files()).collect());
        self.summary.seconds = start.elapsed().as_secs_f64();
        result
    }

    fn work(&mut self, source: Box<dyn FrameSource>, begin: Begin<'_>, progress: &dyn Progress) -> Result<()> {
        let total = source.len_hint().unwrap_or(0);
        let frames = Prefetch::start(source)?;
        let next = |done: usize| {
            progress.step(done, total)?;
            frames.next(|| progress.step(done, total))
        };
        let first = next(0)?.ok_or_else(|| too_few(0))?;
        let mut size = Some(first.size());
        let mut levels = GreyLevels::decide(&first);
        let Begun { mut trackers, sinks } = begin(&self.prepared(&first, levels))?;
        self.sinks = sinks;
        let states: Vec<TrackState> = trackers.iter().map(|tracker| tracker.state().clone()).collect();
        self.deliver(&first, frames.last_time(), &states)?;
        drop(first);
        while let Some(frame) = next(self.summary.frames)? {
            check_size(&mut size, frame.size(), self.numbering.index(self.summary.frames))?;
            levels = levels.revised(std::slice::from_ref(&frame));
            let grey = self.prepared(&frame, levels);
            let states = self.threads.install(|| {
                let states = parallel::map(&mut trackers, |tracker| tracker.update(&grey));
                states.into_iter().collect::<Result<Vec<TrackState>>>()
            })?;
            self.deliver(&frame, frames.last_time(), &states)?;
        }
        progress.step(self.summary.frames, total)?;
        if self.summary.frames < 2 { Err(too_few(self.summary.frames)) } else { Ok(()) }
    }

    /// The frame after preparation, in grey levels.
    fn prepared(&self, frame: &AnyFrame, levels: GreyLevels) -> Frame<f64> {
        let preprocess = &self.preprocess;
        let prepared = self.threads.install(|| preprocess.apply(frame.to_real::<f64>()));
        GreyLevels::scaled(prepared, levels.gain(frame))
    }

    fn deliver(&mut self, frame: &AnyFrame, own_time: Option<f64>, states: &[TrackState]) -> Result<()> {
        let frame_index = self.numbering.index(self.summary.frames);
        let time = self.numbering.time_of(frame_index, own_time);
        let step = TrackStep { frame_index, time, frame, states };
        for sink in &mut self.sinks {
            sink.accept(&step)?;
        }
        self.summary.frames += 1;
        for (number, state) in (1..).zip(states) {
            self.summary.count(number, state);
        }
        Ok(())
    }
}

impl TrackSummary {
    /// Notes target `number` at one more frame.
    pub(in crate::pipeline) fn count(&mut self, number: u64, state: &TrackState) {
        let at = self.targets.partition_point(|target| target.number < number);
        if self.targets.get(at).is_none_or(|target| target.number != number) {
            let counts = [0; TrackStatus::ALL.len()];
            self.targets.insert(at, TargetSummary { number, counts, last: state.clone() });
        }
        let target = &mut self.targets[at];
        target.counts[state.status as usize] += 1;
        target.last = state.clone();
    }

    /// Notes what the sinks have in place at the end of a run.
    pub(in crate::pipeline) fn note_files(&mut self, of_sinks: Vec<(usize, Option<PathBuf>)>) {
        self.files = of_sinks.iter().map(|(number, _)| number).sum();
        self.latest_of_sinks = of_sinks.into_iter().map(|(_, latest)| latest).collect();
        self.latest = self.latest_of_sinks.iter().rev().flatten().next().cloned();
    }
}

/// The error of a sequence of fewer than two frames.
pub(in crate::pipeline) fn too_few(frames: usize) -> Error {
    Error::argument("frames", "at least 2 frames to track through", frames)
}
