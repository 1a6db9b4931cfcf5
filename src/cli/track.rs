//! `jacoflow track`: targets, or everything that moves before two cameras, followed from frame to frame.

mod gradient;
mod output;
mod particle;
mod report;
mod stereo;

use super::arguments::{
    InputArguments, MessageArguments, ParticleTrackerArguments, StereoTrackerArguments, TargetArguments,
    ThreadArguments, TrackerArguments,
};
use super::interrupt::Watch;
use super::paths::CommandPaths;
use super::report::Report;
use crate::error::{Error, Result};
use crate::pipeline::{StereoFormat, TrackFormat};
use clap::Args;
use output::TrackOutputArguments;
use std::path::PathBuf;

/// Options of `track`.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(
    after_help = "gradient follows given targets in one view, particle given targets that may look alike, cross and hide each other in colour frames, stereo everything that moves before two cameras (two inputs, or one with --layout).\n\n\
    gradient: csv has one row a target and frame: status, position, velocity, acceleration, box, scale, rotation, visibility, ..., and the covariance; mot is\n\
    the MOT challenge's frame,id,x,y,w,h,conf,-1,-1,-1, counted from 1. Targets are followed independently of each other.\n\
    particle: csv has, beside these, effective sample size, similarity of colours and number of tracks; mot has confidence 0 while a target is hidden.\n\
    stereo: csv has one row a cluster and step (track, group, x, y, disparity, motion, covariance, ...), json the graph of all clusters. Brightness is\n\
    taken on the scale 0 to 255: 16-bit samples are divided by 257, floats multiplied by 255 unless at least half of what is not dark\n\
    (above 0.1) exceeds 1.5.\n\
    What exists is not replaced without --force, and pictures of an earlier run not before the new one is complete. When a run is stopped (Ctrl-C), what\n\
    there is is kept in name.partial.csv, ....\n\n\
    Examples:\n  \
    jacoflow track video.y4m > track.csv\n  \
    jacoflow track frames/ --bbox 120,80,24,30 --bbox 40,60,12,12 -o out/ --format csv,mot\n  \
    jacoflow track video.mp4 --luminance --center 64,48 -o track.csv --overlay pictures/\n  \
    jacoflow track frames/ --method particle --bbox 40,60,24,66 --bbox 90,58,26,70 --mot out.txt --csv out.csv --overlay out.y4m\n  \
    jacoflow track frames/ --method particle --boxes first.csv --mot out.txt --foreground maps/\n  \
    jacoflow track left/ right/ --method stereo -o out/ --format csv,json --overlay pictures/ --graph graph.png\n  \
    jacoflow track video.mp4 --luminance --layout side-by-side --method stereo --cameras 800,0.12 -o clusters.csv"
)]
pub struct TrackCommand {
    #[command(flatten)]
    pub input: InputArguments,
    #[command(flatten)]
    pub targets: TargetArguments,
    #[command(flatten)]
    pub tracker: TrackerArguments,
    #[command(flatten)]
    pub particle: ParticleTrackerArguments,
    #[command(flatten)]
    pub stereo: StereoTrackerArguments,
    #[command(flatten)]
    pub output: TrackOutputArguments,
    #[command(flatten)]
    pub threads: ThreadArguments,
    #[command(flatten)]
    pub messages: MessageArguments,
}

impl TrackCommand {
    /// Runs the command.
    pub fn execute(&self, watch: &Watch) -> Result<Report> {
        let method = self.tracker.method()?;
        let _new_folders = self.paths(method).check(self.output.force)?;
        if self.output.enlarge > 1 && self.output.overlay.is_none() && self.stereo.disparity_overlay.is_none() {
            return Err(Error::argument(
                "enlarge",
                "an enlargement of pictures, beside --overlay",
                self.output.enlarge,
            ));
        }
        match method {
            "stereo" => self.follow_everything(watch),
            "particle" => self.follow_by_particles(watch),
            _ => self.follow_targets(watch),
        }
    }

    /// What the command reads and writes.
    fn paths(&self, method: &str) -> CommandPaths {
        let files = self.particle.box_file.iter().chain(&self.stereo.times);
        let mut paths = CommandPaths::of_input(&self.input.input).reading(files.map(PathBuf::as_path));
        if let Some(output) = &self.output.output {
            let texts = match method {
                "stereo" => self.output.files::<StereoFormat>(output),
                _ => self.output.files::<TrackFormat>(output),
            };
            paths = paths.writing_files("output", output, texts, []);
        }
        paths
            .writing_pictures("overlay", self.output.overlay.as_deref(), "track")
            .writing_pictures("disparity-overlay", self.stereo.disparity_overlay.as_deref(), "stereo")
            .writing_pictures("foreground", self.particle.foreground.as_deref(), "foreground")
            .writing("graph", self.stereo.graph.as_deref())
            .writing("mot", self.particle.mot.as_deref())
            .writing("csv", self.particle.csv.as_deref())
    }

    /// Refuses an option that belongs to another method.
    fn refuse(&self, given: Option<&'static str>, method: &str) -> Result<()> {
        match given {
            Some(option) => {
                let expected = format!("no such option, which is for --method {method}, here");
                Err(Error::argument(option, expected, format!("--method {}", self.tracker.method)))
            }
            None => Ok(()),
        }
    }
}
