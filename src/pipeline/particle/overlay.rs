//! Targets over colour frames, as pictures or a sequence.

use super::ParticleFrame;
use crate::error::Result;
use crate::image::picture::{GreyRange, PathPoint, TrackColours, TrackOverlay};
use crate::pipeline::album::Album;
use crate::pipeline::sink::{Ending, Sink};
use crate::pipeline::track::PATH_LENGTH;
use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};

/// First word of the files' names.
const STEM: &str = "track";

/// Writes every frame with its targets, each in a colour of its own, as `track_000012.png`, numbered as in
/// the input, each whole, or as one sequence.
#[derive(Debug)]
pub struct ParticleOverlays {
    album: Album,
    overlay: TrackOverlay,
    range: Option<GreyRange>,
    paths: BTreeMap<u64, VecDeque<PathPoint>>,
}

impl ParticleOverlays {
    /// Pictures in a folder, which is made when it does not exist, or, by the name `*.y4m`, a sequence of
    /// `frame_rate` frames per second that appears when it is finished.
    pub fn create(path: impl AsRef<Path>, overlay: TrackOverlay, frame_rate: f64) -> Result<Self> {
        let album = Album::create(path.as_ref(), STEM, "overlay", frame_rate)?;
        let overlay = TrackOverlay { colours: TrackColours::Target, ..overlay };
        Ok(Self { album, overlay, range: None, paths: BTreeMap::new() })
    }
}

impl Sink<ParticleFrame<'_>> for ParticleOverlays {
    fn accept(&mut self, step: &ParticleFrame<'_>) -> Result<()> {
        let range = *self.range.get_or_insert_with(|| GreyRange::of_colour(step.frame));
        let mut picture = range.colour_picture(step.frame);
        if self.overlay.enlargement > 1 {
            picture = picture.enlarged(self.overlay.enlargement);
        }
        for target in step.targets {
            let path = self.paths.entry(target.id).or_default();
            if path.len() == PATH_LENGTH {
                path.pop_front();
            }
            path.push_back((target.state.position, target.state.status));
            self.overlay.draw(&mut picture, target.id as usize, &target.state, path.make_contiguous());
        }
        self.album.add(step.frame_index, &picture)
    }

    fn finish(&mut self, ending: Ending) -> Result<()> {
        self.album.finish(ending)
    }

    fn files(&self) -> (usize, Option<PathBuf>) {
        self.album.files()
    }
}
