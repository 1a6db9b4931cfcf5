//! Targets followed by particle filters, in colour.

use super::{TrackCommand, output::TrackOutputArguments, output::Wanted};
use crate::cli::{interrupt::Watch, open::open_colour_input, progress::Bar, report::Report};
use crate::error::{Error, Result};
use crate::image::picture::TrackOverlay;
use crate::parallel::Threads;
use crate::pipeline::{
    ForegroundMaps, Overlays, ParticleRows, ParticleRun, ParticleSink, TableTarget, TrackFormat, check_target,
};
use serde_json::json;
use std::path::PathBuf;

impl TrackCommand {
    /// Runs the command with the particle tracker.
    pub(super) fn follow_by_particles(&self, watch: &Watch) -> Result<Report> {
        self.refuse(self.targets.points.first().map(|_| "center").or(self.tracker.given()), "gradient")?;
        self.refuse(self.stereo.given(), "stereo")?;
        self.refuse_changes_of_grey()?;
        let mode = self.tracker.particle_mode();
        let options = self.particle.options(mode, self.tracker.random_state, Threads::new(self.threads.threads)?)?;
        let wanted = self.texts()?;
        self.check_pictures_of_particles()?;
        let opened = open_colour_input(&self.input)?;
        if let Some(frames) = opened.frames.filter(|frames| *frames < 2) {
            return Err(Error::argument("frames", "at least 2 frames to track through", frames));
        }
        // Where the input says how many frames it has, a target that starts after them is noticed now.
        let starts = self.particle.starts(&self.targets.boxes, opened.numbering, opened.frames)?;
        let (width, height) = opened.first.size;
        let rate = opened.numbering.rate;
        let details = json!({
            "input": opened.name, "width": width, "height": height, "dtype": opened.first.dtype, "fps": rate,
            "method": self.tracker.method, "mode": mode.name(), "particles": options.n_particles, "random_state": options.random_state,
            "mot": self.particle.mot, "csv": self.particle.csv, "foreground": self.particle.foreground,
        });
        let mut run = ParticleRun::new(&starts, options, opened.numbering);
        let begin = || self.particle_sinks(&wanted, rate);
        let failure = {
            let bar = Bar::new(watch, "track", self.messages.quiet);
            run.run(opened.source, Box::new(begin), &bar).err()
        };
        Ok(self.report(&run.summary(), failure, details))
    }

    /// Refuses what is done to grey frames: the tracker reads colour.
    fn refuse_changes_of_grey(&self) -> Result<()> {
        let given = [
            self.input.selection.luminance.then_some("luminance"),
            self.input.quantise.map(|_| "quantise"),
            self.input.smooth.map(|_| "smooth"),
        ];
        match given.into_iter().flatten().next() {
            Some(option) => {
                let expected = "no such option, which is for grey frames: colour is needed";
                Err(Error::argument(option, expected, format!("--method {}", self.tracker.method)))
            }
            None => Ok(()),
        }
    }

    /// The texts to write: those of --output, --mot and --csv, checked before any work is done.
    fn texts(&self) -> Result<Vec<Wanted<TrackFormat>>> {
        let given = [(&self.particle.mot, TrackFormat::Mot, "mot"), (&self.particle.csv, TrackFormat::Csv, "csv")];
        let pictures = self.output.overlay.is_some() || self.particle.foreground.is_some();
        let any = given.iter().any(|(path, ..)| path.is_some());
        let mut wanted = self.output.wanted(self.messages.json, pictures || any)?;
        for (path, format, option) in given {
            let Some(path) = path else { continue };
            check_target(path, self.output.force).map_err(|error| error.about(option))?;
            wanted.push((TableTarget::File(path.clone()), format));
        }
        Ok(wanted)
    }

    /// Refuses what could only fail after work has been done.
    fn check_pictures_of_particles(&self) -> Result<()> {
        let checked = |path: &&PathBuf| !self.output.force && !self.output.is_in_new_folder(path);
        if let Some(path) = self.output.overlay.as_ref().filter(checked) {
            Overlays::check(path)?;
        }
        if let Some(path) = self.particle.foreground.as_ref().filter(checked) {
            ForegroundMaps::check(path)?;
        }
        Ok(())
    }

    /// Begins what is written; folders are made.
    fn particle_sinks(&self, wanted: &[Wanted<TrackFormat>], rate: Option<f64>) -> Result<Vec<Box<ParticleSink>>> {
        self.output.make_folder()?;
        let rate = TrackOutputArguments::frame_rate(rate);
        let mut sinks: Vec<Box<ParticleSink>> = Vec::new();
        if let Some(path) = &self.output.overlay {
            let drawing = TrackOverlay { enlargement: self.output.enlarge, ..TrackOverlay::default() };
            sinks.push(Box::new(Overlays::create(path, drawing, rate)?));
        }
        if let Some(path) = &self.particle.foreground {
            sinks.push(Box::new(ForegroundMaps::create(path, rate)?));
        }
        for (target, format) in wanted {
            sinks.push(Box::new(ParticleRows::create(target, *format)?));
        }
        Ok(sinks)
    }
}
