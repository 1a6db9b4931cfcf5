//! `jacoflow track`: targets followed from frame to frame.

use super::arguments::{InputArguments, TargetArguments, TellArguments, TrackerArguments};
use super::interrupt::Watch;
use super::open::{Opened, open_input, preprocess};
use super::progress::Bar;
use super::report::{Report, tell};
use crate::error::{Error, Result};
use crate::image::picture::TrackOverlay;
use crate::parallel::Threads;
use crate::pipeline::{
    Begun, Overlays, TableTarget, TargetSummary, TrackFormat, TrackRows, TrackRun, TrackSink, TrackSummary,
    check_target, is_device, is_folder,
};
use crate::track::gradient::{GradientOptions, Start};
use crate::track::{GradientTracker, Tracker};
use crate::types::{Frame, TrackStatus};
use clap::Args;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Options of `track`.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(
    after_help = "csv has one row a target and frame: status, position, velocity, acceleration, box, scale, rotation, visibility, ..., and the covariance; mot is\n\
    the MOT challenge's frame,id,x,y,w,h,conf,-1,-1,-1, counted from 1. Targets are followed independently of each other. Brightness is\n\
    taken on the scale 0 to 255: 16-bit samples are divided by 257, floats that do not exceed 1.5 in the first frame multiplied by 255.\n\
    What exists is not replaced without --force. When a run is stopped (Ctrl-C), rows are kept in name.partial.csv.\n\n\
    Examples:\n  \
    jacoflow track film.y4m > track.csv\n  \
    jacoflow track frames/ --box 120,80,24,30 --box 40,60,12,12 -o out/ --format csv,mot\n  \
    jacoflow track film.mp4 --luminance --point 64,48 -o track.csv --overlay pictures/"
)]
pub struct TrackCommand {
    #[command(flatten)]
    pub input: InputArguments,
    #[command(flatten)]
    pub targets: TargetArguments,
    #[command(flatten)]
    pub tracker: TrackerArguments,
    /// A folder (for tracks.csv, tracks.txt), a .csv file, a .txt file (mot), or - for standard output [default: -, but none with --json or --overlay]
    #[arg(long, short, value_name = "OUT", help_heading = "Output")]
    pub output: Option<PathBuf>,
    /// Formats: csv (everything), mot (boxes) [default: by the file's name, else csv]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', help_heading = "Output")]
    pub format: Vec<String>,
    /// Draw the targets over every frame: a folder for track_000000.png, ..., or a film by the name *.y4m
    #[arg(long, value_name = "FOLDER|FILM", help_heading = "Output")]
    pub overlay: Option<PathBuf>,
    /// Enlarge the drawn pictures N times, for small targets
    #[arg(long, value_name = "N", default_value = "1", requires = "overlay", help_heading = "Output", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=16))]
    pub enlarge: usize,
    /// Replace files that exist
    #[arg(long, help_heading = "Output")]
    pub force: bool,
    /// Number of threads; the result does not depend on it [default: JACOFLOW_THREADS, else every processor]
    #[arg(long, value_name = "N", help_heading = "Computation", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..))]
    pub threads: Option<usize>,
    #[command(flatten)]
    pub tell: TellArguments,
}

/// Frames per second of a film where the input does not tell.
const FILM_RATE: f64 = 25.0;

/// A text that is to be written.
type Wanted = (TableTarget, TrackFormat);

impl TrackCommand {
    /// Runs the command.
    pub fn execute(&self, watch: &Watch) -> Result<Report> {
        let options = self.tracker.options()?;
        let threads = Threads::new(self.threads)?;
        let wanted = self.wanted()?;
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
            let bar = Bar::new(watch, "track", self.tell.quiet);
            run.run(opened.source, Box::new(begin), &bar).err()
        };
        Ok(self.report(&run.summary(), failure, details))
    }

    /// Begins what is written; folders are made.
    fn sinks(&self, wanted: &[Wanted], rate: Option<f64>) -> Result<Vec<Box<dyn TrackSink>>> {
        if let Some(folder) = self.output.as_deref().filter(|path| *path != Path::new("-") && is_folder(path)) {
            std::fs::create_dir_all(folder).map_err(|source| Error::io(folder, source))?;
        }
        let mut sinks: Vec<Box<dyn TrackSink>> = Vec::new();
        if let Some(path) = &self.overlay {
            sinks.push(Box::new(Overlays::create(path, self.drawing(), rate.unwrap_or(FILM_RATE))?));
        }
        for (target, format) in wanted {
            sinks.push(Box::new(TrackRows::create(target, *format)?));
        }
        Ok(sinks)
    }

    /// The texts to write, checked before any work is done.
    fn wanted(&self) -> Result<Vec<Wanted>> {
        let formats: Vec<TrackFormat> =
            self.format.iter().map(|name| TrackFormat::parse(name)).collect::<Result<_>>()?;
        if let Some(folder) = &self.overlay
            && !self.force
        {
            Overlays::check(folder)?;
        }
        let path = match &self.output {
            Some(path) => path,
            // The summary or the pictures are what is wanted then.
            None if (self.tell.json || self.overlay.is_some()) && formats.is_empty() => return Ok(Vec::new()),
            None => Path::new("-"),
        };
        if path == Path::new("-") {
            self.on_standard_output(&formats)
        } else if is_folder(path) {
            self.in_folder(path, &formats)
        } else {
            self.in_file(path, &formats)
        }
    }

    fn on_standard_output(&self, formats: &[TrackFormat]) -> Result<Vec<Wanted>> {
        if self.tell.json {
            return Err(Error::argument("output", "a file or folder, as --json needs standard output", "-"));
        }
        match formats {
            [] => Ok(vec![(TableTarget::StandardOutput, TrackFormat::Csv)]),
            [format] => Ok(vec![(TableTarget::StandardOutput, *format)]),
            _ => Err(Error::argument("output", "a folder for several formats", "standard output")),
        }
    }

    fn in_folder(&self, folder: &Path, formats: &[TrackFormat]) -> Result<Vec<Wanted>> {
        let formats = if formats.is_empty() { &[TrackFormat::Csv] } else { formats };
        let path = |format: TrackFormat| folder.join(format!("tracks.{}", format.extension()));
        if folder.is_dir() {
            formats.iter().try_for_each(|format| check_target(&path(*format), self.force))?;
        }
        Ok(formats.iter().map(|format| (TableTarget::File(path(*format)), *format)).collect())
    }

    fn in_file(&self, path: &Path, formats: &[TrackFormat]) -> Result<Vec<Wanted>> {
        if is_device(path) {
            let formats = if formats.is_empty() { &[TrackFormat::Csv] } else { formats };
            let [format] = formats else {
                return Err(Error::argument("output", "a folder for several formats", path.display()));
            };
            return Ok(vec![(TableTarget::File(path.to_path_buf()), *format)]);
        }
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        let Some(by_name) = TrackFormat::ALL.into_iter().find(|format| format.extension() == extension) else {
            let wanted = "a .csv or .txt file, a folder, or - for standard output";
            let got = format!("{0}; for a new folder of this name write {0}/", path.display());
            return Err(Error::argument("output", wanted, got));
        };
        if let Some(other) = formats.iter().find(|format| **format != by_name) {
            let got = format!("{} for {}", path.display(), other.name());
            return Err(Error::argument("output", "a folder, or a file named by its format (.csv, .txt for mot)", got));
        }
        check_target(path, self.force)?;
        Ok(vec![(TableTarget::File(path.to_path_buf()), by_name)])
    }

    /// How targets are drawn.
    fn drawing(&self) -> TrackOverlay {
        TrackOverlay { enlargement: self.enlarge, ..TrackOverlay::default() }
    }

    fn details(&self, opened: &Opened) -> Value {
        let (width, height) = opened.first.size;
        json!({
            "input": opened.name, "width": width, "height": height, "dtype": opened.first.dtype, "fps": opened.numbering.rate,
            "method": self.tracker.method, "mode": format!("{:?}", self.tracker.mode).to_lowercase(),
        })
    }

    fn report(&self, summary: &TrackSummary, failure: Option<Error>, details: Value) -> Report {
        let interrupted = matches!(failure, Some(Error::Interrupted));
        let output = match (&summary.latest, &self.output) {
            // The rows of a run that was stopped have another name than was asked for.
            (Some(file), Some(asked)) if !is_folder(asked) && file.extension() == asked.extension() => Some(file),
            (_, asked) => asked.as_ref(),
        };
        // Pictures are the first of the sinks. A film that was stopped has another name, too, or was not begun.
        let overlay = match &self.overlay {
            Some(film) if !is_folder(film) => summary.latest_of_sinks.first().and_then(Option::as_ref),
            folder => folder.as_ref(),
        };
        if !self.tell.quiet && (failure.is_none() || interrupted) {
            let place = output.or(overlay);
            tell(&in_words(summary, place.map(PathBuf::as_path)));
        }
        let mut object = json!({
            "command": "track", "frames": summary.frames, "targets": targets(summary), "files": summary.files,
            "seconds": summary.seconds, "output": output, "overlay": overlay, "interrupted": interrupted,
        });
        if let (Some(object), Value::Object(details)) = (object.as_object_mut(), details) {
            object.extend(details);
        }
        Report { summary: object, failure }
    }
}

/// A tracker for each target.
fn trackers(frame: &Frame<f64>, starts: &[Start], options: &GradientOptions) -> Result<Vec<Box<dyn Tracker>>> {
    let begin = |(index, start): (usize, &Start)| -> Result<Box<dyn Tracker>> {
        let tracker = GradientTracker::new(frame, *start, options).map_err(|error| in_our_words(error, index + 1))?;
        Ok(Box::new(tracker))
    };
    starts.iter().enumerate().map(begin).collect()
}

/// An error of a tracker under the names that this command has for its arguments, with the target that it is about.
fn in_our_words(error: Error, target: usize) -> Error {
    let named =
        |ours, expected, got| Error::Argument { argument: ours, expected, got: format!("{got} (target {target})") };
    match error {
        Error::Argument { argument: "bbox", expected, got } => named("box", expected, got),
        Error::Argument { argument: "center", expected, got } => named("point", expected, got),
        other => other,
    }
}

/// The targets for the summary: how often each status was, and the last state.
fn targets(summary: &TrackSummary) -> Value {
    let one = |(index, target): (usize, &TargetSummary)| {
        let counts: serde_json::Map<String, Value> = TrackStatus::ALL
            .into_iter()
            .map(|status| (status.name().to_string(), json!(target.counts[status as usize])))
            .collect();
        let (last, bounds) = (&target.last, target.last.bounds);
        json!({
            "target": index + 1, "frames": counts, "status": last.status.name(), "reason": last.reason,
            "position": last.position, "velocity": last.velocity, "visibility": last.visibility,
            "box": [bounds.x, bounds.y, bounds.width, bounds.height],
        })
    };
    summary.targets.iter().enumerate().map(one).collect()
}

fn in_words(summary: &TrackSummary, output: Option<&Path>) -> String {
    let mut parts = vec![format!("{} frames", summary.frames)];
    for (index, target) in summary.targets.iter().enumerate() {
        let measured = target.counts[TrackStatus::Tracking as usize] + target.counts[TrackStatus::Occluded as usize];
        let share = 100.0 * measured as f64 / summary.frames.max(1) as f64;
        parts.push(format!("target {}: seen in {share:.1} %, at last {}", index + 1, target.last.status.name()));
    }
    parts.push(format!("{:.2} s", summary.seconds));
    if let Some(output) = output.filter(|output| summary.files > 0 && *output != Path::new("-")) {
        let files = if summary.files == 1 { "file" } else { "files" };
        parts.push(format!("{} {files}: {}", summary.files, output.display()));
    }
    parts.join(", ")
}
