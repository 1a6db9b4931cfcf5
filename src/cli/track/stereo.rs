//! Everything that moves before two cameras, followed by the stereo tracker.

use super::{TrackCommand, output::TrackOutputArguments, output::Wanted, output::files_in_words};
use crate::cli::interrupt::Watch;
use crate::cli::open::preprocess;
use crate::cli::progress::Bar;
use crate::cli::report::{Report, print_message};
use crate::cli::stereo::rows_doubted;
use crate::error::{Error, Result};
use crate::parallel::Threads;
use crate::pipeline::{
    ClusterRows, GraphChart, GraphFile, GreyPairs, StereoFormat, StereoOverlays, StereoPicture, StereoRun, StereoSink,
    StereoSummary, check_target,
};
use crate::track::StereoTracker;
use crate::track::stereo::{ARC_THRESHOLD, StereoTrackerOptions};
use serde_json::json;
use std::path::{Path, PathBuf};

impl TrackCommand {
    /// Runs the command with the stereo tracker.
    pub(super) fn follow_everything(&self, watch: &Watch) -> Result<Report> {
        self.refuse(self.targets.given().or(self.tracker.given()), "gradient")?;
        self.refuse(self.particle.given(), "particle")?;
        self.input.selection.check_count(2, "pairs of views to track through")?;
        let threads = Threads::new(self.threads.threads)?;
        let options = self.stereo.options(self.tracker.stereo_mode(), self.tracker.random_state, threads)?;
        let pictures = self.pictures(&options);
        let drawn = !pictures.is_empty() || self.stereo.graph.is_some();
        let wanted = self.output.wanted(self.messages.json, drawn)?;
        self.check_pictures(&pictures)?;
        let (views, numbering) = self.stereo.layout.open(&self.input.input, &self.input.selection, self.input.fps)?;
        let times = self.stereo.times(numbering)?;
        let name = views.describe();
        let pairs = GreyPairs::start(views, preprocess(&self.input, None)?, threads)?;
        let threshold = ARC_THRESHOLD;
        let mode = options.mode.name();
        let mut run = StereoRun::new(StereoTracker::new(options)?, numbering).with_times(times);
        let begin = || self.stereo_sinks(&wanted, &pictures, threshold, numbering.rate);
        let failure = {
            let bar = Bar::new(watch, "track", self.messages.quiet);
            run.run(pairs, Box::new(begin), &bar).err()
        };
        let summary = run.summary();
        let interrupted = matches!(failure, Some(Error::Interrupted));
        let output = self.output.place(summary.latest.as_ref());
        if !self.messages.quiet && (failure.is_none() || interrupted) {
            let drawn = pictures.first().map(|(path, _)| *path).or(self.stereo.graph.as_ref());
            print_message(&in_words(&summary, output.or(drawn).map(PathBuf::as_path)));
        }
        let object = json!({
            "command": "track", "method": self.tracker.method, "mode": mode, "input": name, "fps": numbering.rate,
            "frames": summary.pairs, "edge_pixels": summary.pixels, "clusters": summary.clusters, "tracks": summary.tracks,
            "row_offset": summary.row_offset, "rows_doubtful": summary.rows_doubtful, "files": summary.files, "seconds": summary.seconds, "output": output,
            "overlay": self.output.overlay, "disparity_overlay": self.stereo.disparity_overlay, "graph": self.stereo.graph,
            "interrupted": interrupted,
        });
        Ok(Report { summary: object, failure })
    }

    /// What is drawn over the left views, and where that goes.
    fn pictures(&self, options: &StereoTrackerOptions) -> Vec<(&PathBuf, StereoPicture)> {
        let [far, near] = options.disparity_range.map(f64::from);
        let clusters = self.output.overlay.iter().map(|path| (path, StereoPicture::Clusters));
        let disparities = self.stereo.disparity_overlay.iter();
        clusters.chain(disparities.map(|path| (path, StereoPicture::Disparities(far, near)))).collect()
    }

    /// Refuses what could only fail after work has been done.
    fn check_pictures(&self, pictures: &[(&PathBuf, StereoPicture)]) -> Result<()> {
        if let Some(path) = &self.stereo.graph {
            if path.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case("png")) {
                return Err(Error::argument("graph", "a .png file", path.display()));
            }
            if !self.output.is_in_new_folder(path) {
                check_target(path, self.output.force).map_err(|error| error.about("graph"))?;
            }
        }
        if self.output.force {
            return Ok(());
        }
        let mut checked = pictures.iter().filter(|(path, _)| !self.output.is_in_new_folder(path));
        checked.try_for_each(|(path, kind)| StereoOverlays::check(path, *kind))
    }

    /// Begins what is written; folders are made.
    fn stereo_sinks(
        &self,
        wanted: &[Wanted<StereoFormat>],
        pictures: &[(&PathBuf, StereoPicture)],
        threshold: f64,
        rate: Option<f64>,
    ) -> Result<Vec<Box<dyn StereoSink>>> {
        self.output.make_folder()?;
        let mut sinks: Vec<Box<dyn StereoSink>> = Vec::new();
        for (path, kind) in pictures {
            let rate = TrackOutputArguments::frame_rate(rate);
            sinks.push(Box::new(StereoOverlays::create(path, *kind, self.output.enlarge, rate)?));
        }
        if let Some(path) = &self.stereo.graph {
            sinks.push(Box::new(GraphChart::new(path.clone(), threshold)));
        }
        for (target, format) in wanted {
            sinks.push(match format {
                StereoFormat::Csv => Box::new(ClusterRows::create(target)?),
                StereoFormat::Json => Box::new(GraphFile::new(target.clone())),
            });
        }
        Ok(sinks)
    }
}

fn in_words(summary: &StereoSummary, output: Option<&Path>) -> String {
    let pairs = summary.pairs.max(1);
    let mut parts = vec![format!("{} pairs", summary.pairs)];
    parts.push(format!("{} edge pixels and {} clusters each", summary.pixels / pairs, summary.clusters / pairs));
    parts.push(format!("{} tracks", summary.tracks));
    parts.extend(summary.row_offset.map(|rows| format!("row offset {rows:.2}")));
    parts.push(format!("{:.2} s", summary.seconds));
    parts.extend(files_in_words(summary.files, output));
    parts.join(", ") + &rows_doubted(summary.rows_doubtful)
}
