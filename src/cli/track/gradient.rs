//! Targets followed by the gradient tracker.

use super::{TrackCommand, output::TrackOutputArguments, output::Wanted};
use crate::cli::interrupt::Watch;
use crate::cli::open::{Opened, open_input, preprocess};
use crate::cli::progress::Bar;
use crate::cli::report::Report;
use crate::error::{Error, Result};
use crate::image::picture::TrackOverlay;
use crate::parallel::Threads;
use crate::pipeline::{Begun, Overlays, TrackFormat, TrackRows, TrackRun, TrackSink};
use crate::track::gradient::{GradientOptions, Start};
use crate::track::{GradientTracker, Tracker};
use crate::types::Frame;
use serde_json::{Value, json};
use std::path::PathBuf;

impl TrackCommand {
    /// Runs the command with the gradient tracker.
    pub(super) fn follow_targets(&self, watch: &Watch) -> Result<Report> {
        self.refuse(self.stereo.given(), "stereo")?;
        self.refuse(self.particle.given(), "particle")?;
        self.refuse(self.tracker.random_state.map(|_| "random_state"), "stereo or particle")?;
        let options = self.tracker.gradient()?;
        let threads = Threads::new(self.threads.threads)?;
        let wanted = self.output.wanted(self.messages.json, self.output.overlay.is_some())?;
        let checked = |place: &&PathBuf| !self.output.force && !self.output.is_in_new_folder(place);
        if let Some(place) = self.output.overlay.as_ref().filter(checked) {
            Overlays::check(place)?;
        }
        let opened = open_input(&self.input)?;
        if let Some(frames) = opened.frames.filter(|frames| *frames < 2) {
            return Err(Error::argument("frames", "at least 2 frames to track through", frames));
        }
        let mut run = TrackRun::default()
            .with_preprocess(preprocess(&self.input, None)?)
            .with_threads(threads)
            .with_numbering(opened.numbering);
        let details = self.details(&opened);
        let rate = opened.numbering.rate;
        let begin = |frame: &Frame<f64>| {
            let trackers = trackers(frame, &self.targets.starts(), &options)?;
            Ok(Begun { trackers, sinks: self.sinks(&wanted, rate)? })
        };
        let failure = {
            let bar = Bar::new(watch, "track", self.messages.quiet);
            run.run(opened.source, Box::new(begin), &bar).err()
        };
        Ok(self.report(&run.summary(), failure, details))
    }

    /// Begins what is written; folders are made.
    fn sinks(&self, wanted: &[Wanted<TrackFormat>], rate: Option<f64>) -> Result<Vec<Box<TrackSink>>> {
        self.output.make_folder()?;
        let mut sinks: Vec<Box<TrackSink>> = Vec::new();
        if let Some(path) = &self.output.overlay {
            let drawing = TrackOverlay { enlargement: self.output.enlarge, ..TrackOverlay::default() };
            sinks.push(Box::new(Overlays::create(path, drawing, TrackOutputArguments::frame_rate(rate))?));
        }
        for (target, format) in wanted {
            sinks.push(Box::new(TrackRows::create(target, *format)?));
        }
        Ok(sinks)
    }

    fn details(&self, opened: &Opened) -> Value {
        let (width, height) = opened.first.size;
        json!({
            "input": opened.name, "width": width, "height": height, "dtype": opened.first.dtype, "fps": opened.numbering.rate,
            "method": self.tracker.method,
        })
    }
}

/// A tracker for each target.
fn trackers(frame: &Frame<f64>, starts: &[Start], options: &GradientOptions) -> Result<Vec<Box<dyn Tracker>>> {
    let begin = |(index, start): (usize, &Start)| -> Result<Box<dyn Tracker>> {
        let tracker = GradientTracker::new(frame, *start, options).map_err(|error| of_target(error, index + 1))?;
        Ok(Box::new(tracker))
    };
    starts.iter().enumerate().map(begin).collect()
}

/// An error of a tracker's start with the target that it is about.
fn of_target(error: Error, target: usize) -> Error {
    match error {
        Error::Argument { argument: argument @ ("bbox" | "center"), expected, got } => {
            Error::Argument { argument, expected, got: format!("{got} (target {target})") }
        }
        other => other,
    }
}
