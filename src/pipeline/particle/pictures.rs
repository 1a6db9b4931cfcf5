//! Foreground maps, and targets over their frames, as pictures.

use super::ParticleFrame;
use crate::error::Result;
use crate::image::{picture::GreyRange, picture::TrackColours};
use crate::pipeline::album::Album;
use crate::pipeline::sink::{Sink, ends_as};
use crate::pipeline::track::Overlays;
use std::path::{Path, PathBuf};

/// First word of the files' names.
const STEM: &str = "foreground";
/// Name of the argument in errors.
const ARGUMENT: &str = "foreground";

/// Writes the foreground map of every frame, 0 (background) to 255, as 8-bit grey `foreground_000012.png`,
/// numbered as in the input, each whole, or as one sequence.
#[derive(Debug)]
pub struct ForegroundMaps {
    album: Album,
}

impl ForegroundMaps {
    /// Pictures in a folder, which is made when it does not exist, or, by the name `*.y4m`, a sequence of
    /// `frame_rate` frames per second that appears when it is finished.
    pub fn create(path: impl AsRef<Path>, frame_rate: f64) -> Result<Self> {
        Ok(Self { album: Album::create(path.as_ref(), STEM, ARGUMENT, frame_rate)? })
    }

    /// Refuses a folder that holds maps of an earlier run, and a sequence that exists. Makes nothing.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) named `foreground`.
    pub fn check(path: &Path) -> Result<()> {
        Album::check(path, STEM, ARGUMENT)
    }
}

impl Sink<ParticleFrame<'_>> for ForegroundMaps {
    fn accept(&mut self, step: &ParticleFrame<'_>) -> Result<()> {
        let map = step.tracker.record().foreground()?;
        self.album.add_grey(step.frame_index, map.map(|share| (255.0 * share).round() as u8))
    }

    ends_as!(album);
}

impl Sink<ParticleFrame<'_>> for Overlays {
    fn accept(&mut self, step: &ParticleFrame<'_>) -> Result<()> {
        self.overlay.colours = TrackColours::Target;
        let range = *self.range.get_or_insert_with(|| GreyRange::of_colour(step.frame));
        let targets = step.targets.iter().map(|target| (target.id, &target.state));
        self.draw(step.frame_index, range.colour_picture(step.frame), targets)
    }

    ends_as!(album);
}
