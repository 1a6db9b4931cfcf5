//! From colour frames to targets followed by particle filters: source, tracker, sinks.

mod pictures;
mod rows;

pub use pictures::ForegroundMaps;
pub use rows::ParticleRows;

use super::prefetch::Prefetch;
use super::run::{Numbering, check_size};
use super::sink::{Sink, end_all};
use super::track::{TrackSummary, too_few};
use crate::error::{Error, Result};
use crate::io::ColourSource;
use crate::parallel::Progress;
use crate::track::ParticleTracker;
use crate::track::particle::{ParticleOptions, ParticleTarget};
use crate::types::{AnyColourFrame, TargetBox};
use std::collections::BTreeMap;
use std::time::Instant;

/// The targets at one frame.
#[derive(Debug)]
pub struct ParticleFrame<'a> {
    /// Index of the frame in the input.
    pub frame_index: usize,
    /// Its time, s from the first frame of the input; `None` if the frame rate is not known.
    pub time: Option<f64>,
    /// The frame as it came.
    pub frame: &'a AnyColourFrame,
    /// The targets, in ascending order of their numbers.
    pub targets: &'a [ParticleTarget],
    /// The tracker after this frame.
    pub tracker: &'a ParticleTracker,
}

/// A receiver of targets.
pub type ParticleSink = dyn for<'a> Sink<ParticleFrame<'a>>;

/// Begins the sinks once the tracker has its first targets.
pub type BeginParticleSinks<'a> = Box<dyn FnOnce() -> Result<Vec<Box<ParticleSink>>> + 'a>;

/// A target and where it starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetStart {
    /// Index of the frame in the input.
    pub frame: usize,
    /// Its number.
    pub id: u64,
    /// Its box in that frame, px.
    pub bounds: TargetBox,
}

/// A run: colour frames in, targets out. The result does not depend on the number of threads.
pub struct ParticleRun {
    options: ParticleOptions,
    /// Targets still to start, by the index of their frame in the input.
    starts: BTreeMap<usize, Vec<(u64, TargetBox)>>,
    numbering: Numbering,
    sinks: Vec<Box<ParticleSink>>,
    summary: TrackSummary,
}

impl ParticleRun {
    /// A run that follows each target from its start on; `numbering` says which frames of the input come. A
    /// start at a frame that does not come is ignored.
    pub fn new(starts: &[TargetStart], options: ParticleOptions, numbering: Numbering) -> Self {
        let mut by_frame = BTreeMap::<usize, Vec<(u64, TargetBox)>>::new();
        for start in starts {
            by_frame.entry(start.frame).or_default().push((start.id, start.bounds));
        }
        Self { options, starts: by_frame, numbering, sinks: Vec::new(), summary: TrackSummary::default() }
    }

    /// What was done so far; valid after a failed or interrupted run too.
    pub fn summary(&self) -> TrackSummary {
        self.summary.clone()
    }

    /// Works through `source` and ends every sink, however the run ends.
    ///
    /// `progress` is called with the number of frames read, at least once a frame and while waiting for one;
    /// its error stops the run, and what is complete then stays.
    ///
    /// # Errors
    /// Those of the source, of `begin`, the tracker, the sinks and `progress`. [`Error::Argument`] named
    /// `frames` for fewer than two frames or one of another size; named `box`, with the target's number, for
    /// a box that cannot be followed.
    pub fn run(
        &mut self,
        source: Box<ColourSource>,
        begin: BeginParticleSinks<'_>,
        progress: &dyn Progress,
    ) -> Result<()> {
        let start = Instant::now();
        let worked = self.work(source, begin, progress);
        let result = end_all(worked, &mut self.sinks, |sink, ending| sink.finish(ending));
        self.summary.note_files(self.sinks.iter().map(|sink| sink.files()).collect());
        self.summary.seconds = start.elapsed().as_secs_f64();
        result
    }

    fn work(
        &mut self,
        source: Box<ColourSource>,
        begin: BeginParticleSinks<'_>,
        progress: &dyn Progress,
    ) -> Result<()> {
        let total = source.len_hint().unwrap_or(0);
        let frames = Prefetch::start(source)?;
        let next = |done: usize| {
            progress.step(done, total)?;
            frames.next(|| progress.step(done, total))
        };
        let first = next(0)?.ok_or_else(|| too_few(0))?;
        let mut size = Some(first.size());
        let mut tracker = ParticleTracker::new(&first, &[], &self.options)?;
        let targets = self.with_new(&mut tracker, Vec::new())?;
        self.sinks = begin()?;
        self.deliver(&first, frames.last_time(), &tracker, &targets)?;
        drop(first);
        while let Some(frame) = next(self.summary.frames)? {
            check_size(&mut size, frame.size(), self.numbering.index(self.summary.frames))?;
            let followed = tracker.update(&frame)?.targets.clone();
            let targets = self.with_new(&mut tracker, followed)?;
            self.deliver(&frame, frames.last_time(), &tracker, &targets)?;
        }
        progress.step(self.summary.frames, total)?;
        if self.summary.frames < 2 {
            return Err(too_few(self.summary.frames));
        }
        if self.summary.targets.is_empty() {
            let got = format!("none in {} frames", self.summary.frames);
            return Err(Error::argument("boxes", "a target that starts in one of the frames", got));
        }
        Ok(())
    }

    /// The targets with those that start at this frame.
    fn with_new(
        &mut self,
        tracker: &mut ParticleTracker,
        mut targets: Vec<ParticleTarget>,
    ) -> Result<Vec<ParticleTarget>> {
        let index = self.numbering.index(self.summary.frames);
        for (id, bounds) in self.starts.remove(&index).unwrap_or_default() {
            tracker.add(Some(id), bounds).map_err(|error| of_target(error, id))?;
            let at = targets.partition_point(|target| target.id < id);
            let added = tracker.step().targets.iter().find(|target| target.id == id);
            targets.splice(at..at, added.cloned());
        }
        Ok(targets)
    }

    fn deliver(
        &mut self,
        frame: &AnyColourFrame,
        own_time: Option<f64>,
        tracker: &ParticleTracker,
        targets: &[ParticleTarget],
    ) -> Result<()> {
        let frame_index = self.numbering.index(self.summary.frames);
        let time = self.numbering.time_of(frame_index, own_time);
        let step = ParticleFrame { frame_index, time, frame, targets, tracker };
        for sink in &mut self.sinks {
            sink.accept(&step)?;
        }
        self.summary.frames += 1;
        for target in targets {
            self.summary.count(target.id, &target.state);
        }
        Ok(())
    }
}

/// The error of a box with the target that it is about.
fn of_target(error: Error, id: u64) -> Error {
    match error {
        Error::Argument { argument, expected, got } => {
            Error::Argument { argument, expected, got: format!("{got} (target {id})") }
        }
        other => other,
    }
}
