//! From pairs of views to tracks: views, preparation, grey levels, the stereo tracker, sinks.

mod graph;
mod overlay;
mod pairs;
mod rows;
mod times;

pub use graph::{GraphChart, GraphFile};
pub use overlay::{StereoOverlays, StereoPicture};
pub use pairs::{GreyPair, GreyPairs};
pub use rows::{ClusterRows, StereoFormat};
pub use times::PairTimes;

use super::{run::Numbering, sink::Ending, sink::end_all, sink::in_place};
use crate::error::{Error, Result};
use crate::parallel::Progress;
use crate::track::StereoTracker;
use crate::track::stereo::{Step, TrackGraph};
use crate::types::AnyFrame;
use std::path::PathBuf;
use std::time::Instant;

/// Fewest pairs that can be tracked through.
const MIN_PAIRS: usize = 2;

/// What the tracker says of one pair.
#[derive(Debug)]
pub struct StereoStep<'a> {
    /// Index of the pair in the input.
    pub frame_index: usize,
    /// Its time, s from the first frame of the input; `None` if not known.
    pub time: Option<f64>,
    /// The left view as it came.
    pub left: &'a AnyFrame,
    /// Clusters and edge pixels.
    pub step: &'a Step,
}

/// A receiver of clusters.
pub trait StereoSink: Send {
    /// Takes the clusters of one pair; nothing, where the graph at the end is enough.
    ///
    /// # Errors
    /// Files that cannot be written; the run then ends.
    fn accept(&mut self, _step: &StereoStep<'_>) -> Result<()> {
        Ok(())
    }

    /// Called once at the end, however the run ended, with the clusters of all steps: brings what is complete
    /// under its final name and removes the rest.
    ///
    /// # Errors
    /// Files that cannot be written.
    fn finish(&mut self, ending: Ending, graph: &TrackGraph) -> Result<()>;

    /// Files in place so far: their number and the latest one.
    fn files(&self) -> (usize, Option<PathBuf>);
}

/// Begins the sinks once there is a pair that can be used, so that no file is begun for others.
pub type BeginSinks<'a> = Box<dyn FnOnce() -> Result<Vec<Box<dyn StereoSink>>> + 'a>;

/// What a run did.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StereoSummary {
    /// Pairs taken by every sink.
    pub pairs: usize,
    /// Edge pixels with a disparity, all pairs together.
    pub pixels: usize,
    /// Clusters, all pairs together.
    pub clusters: usize,
    /// Different tracks.
    pub tracks: usize,
    /// How many rows lower the right view shows a point, where that was found or given once for all pairs.
    pub row_offset: Option<f64>,
    /// Number of pairs whose views disagree at every row offset in the range.
    pub rows_doubtful: usize,
    /// Files written.
    pub files: usize,
    /// The last of them, under the name that it really has.
    pub latest: Option<PathBuf>,
    /// Wall-clock seconds.
    pub seconds: f64,
}

/// A run: pairs of views in, clusters and their graph out.
pub struct StereoRun {
    tracker: StereoTracker,
    numbering: Numbering,
    times: Option<PairTimes>,
    sinks: Vec<Box<dyn StereoSink>>,
    summary: StereoSummary,
}

impl StereoRun {
    /// A run of a tracker that has seen nothing yet; `numbering` says which pairs of the input come.
    pub fn new(tracker: StereoTracker, numbering: Numbering) -> Self {
        Self { tracker, numbering, times: None, sinks: Vec::new(), summary: StereoSummary::default() }
    }

    /// The same where pairs come unevenly: velocities are for an ordinary step, and steps have these times.
    pub fn with_times(self, times: Option<PairTimes>) -> Self {
        Self { times, ..self }
    }

    /// What was done so far; valid after a failed or interrupted run too.
    pub fn summary(&self) -> StereoSummary {
        self.summary.clone()
    }

    /// Works through `pairs` and ends every sink, however the run ends.
    ///
    /// `progress` is called with the number of pairs taken, at least once a pair and while waiting for one;
    /// its error stops the run, and what is complete then stays.
    ///
    /// # Errors
    /// Those of the source, of `begin`, the tracker, the sinks and `progress`; [`Error::Argument`] named
    /// `frames` for fewer than two pairs.
    pub fn run(&mut self, mut pairs: GreyPairs, begin: BeginSinks<'_>, progress: &dyn Progress) -> Result<()> {
        let start = Instant::now();
        let worked = self.work(&mut pairs, begin, progress);
        let graph = self.tracker.graph();
        let result = end_all(worked, &mut self.sinks, |sink, ending| sink.finish(ending, graph));
        (self.summary.files, self.summary.latest) = in_place(self.sinks.iter().map(|sink| sink.files()));
        self.summary.tracks = self.tracker.tracks().len();
        self.summary.row_offset = self.tracker.row_offset();
        self.summary.seconds = start.elapsed().as_secs_f64();
        result
    }

    fn work(&mut self, pairs: &mut GreyPairs, begin: BeginSinks<'_>, progress: &dyn Progress) -> Result<()> {
        let mut begin = Some(begin);
        // Two are there before anything is said: of one there is nothing to follow.
        let mut first = Vec::new();
        while first.len() < MIN_PAIRS {
            let Some(pair) = pairs.next(self.summary.pairs, progress)? else {
                let expected = format!("at least {MIN_PAIRS} pairs of views to track through");
                return Err(Error::argument("frames", expected, first.len()));
            };
            first.push(pair);
        }
        for pair in first {
            self.take(pair, &mut begin)?;
        }
        while let Some(pair) = pairs.next(self.summary.pairs, progress)? {
            self.take(pair, &mut begin)?;
        }
        Ok(())
    }

    /// Processes one pair and passes it to the sinks, which begin with the first one.
    fn take(
        &mut self,
        GreyPair { views: [left, _], grey }: GreyPair,
        begin: &mut Option<BeginSinks<'_>>,
    ) -> Result<()> {
        let frame_index = self.numbering.index(self.summary.pairs);
        let time = match &self.times {
            Some(times) => Some(times.at(frame_index)?),
            None => self.numbering.time(frame_index),
        };
        if let Some(times) = self.times.as_ref().filter(|_| self.summary.pairs > 0) {
            self.tracker.after(times.steps(self.numbering.index(self.summary.pairs - 1), frame_index)?)?;
        }
        let step = self.tracker.update(&grey[0], &grey[1])?;
        if let Some(begin) = begin.take() {
            self.sinks = begin()?;
        }
        let followed = StereoStep { frame_index, time, left: &left, step: &step };
        for sink in &mut self.sinks {
            sink.accept(&followed)?;
        }
        self.summary.pairs += 1;
        self.summary.pixels += step.rows.len();
        self.summary.clusters += step.clusters.len();
        self.summary.rows_doubtful += usize::from(step.rows_doubtful);
        Ok(())
    }
}
