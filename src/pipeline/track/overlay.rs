//! Tracks over the frames, as pictures or a sequence.

use super::TrackStep;
use crate::error::Result;
use crate::image::picture::{GreyRange, PathPoint, TrackOverlay};
use crate::pipeline::album::Album;
use crate::pipeline::sink::{Ending, Sink};
use std::collections::VecDeque;
use std::path::{Path, PathBuf};

/// How many frames of a path are drawn: memory and time of a frame stay bounded.
pub const PATH_LENGTH: usize = 1000;

/// First word of the files' names.
const STEM: &str = "track";

/// Writes every frame with its targets as `track_000012.png`, numbered as in the input, or a sequence.
#[derive(Debug)]
pub struct Overlays {
    album: Album,
    overlay: TrackOverlay,
    range: Option<GreyRange>,
    paths: Vec<VecDeque<PathPoint>>,
}

impl Overlays {
    /// Pictures in a folder, which is made when it does not exist, or, by the name `*.y4m`, a sequence of
    /// `frame_rate` frames per second that appears when it is finished.
    pub fn create(path: impl AsRef<Path>, overlay: TrackOverlay, frame_rate: f64) -> Result<Self> {
        let album = Album::create(path.as_ref(), STEM, "overlay", frame_rate)?;
        Ok(Self { album, overlay, range: None, paths: Vec::new() })
    }

    /// Refuses a folder that holds pictures of an earlier run, and a sequence that exists. Makes nothing.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) named `overlay`.
    pub fn check(path: &Path) -> Result<()> {
        Album::check(path, STEM, "overlay")
    }

    /// Remembers where the targets are.
    fn follow(&mut self, step: &TrackStep<'_>) {
        self.paths.resize_with(step.states.len(), VecDeque::new);
        for (path, state) in self.paths.iter_mut().zip(step.states) {
            if path.len() == PATH_LENGTH {
                path.pop_front();
            }
            path.push_back((state.position, state.status));
        }
    }
}

impl Sink<TrackStep<'_>> for Overlays {
    fn accept(&mut self, step: &TrackStep<'_>) -> Result<()> {
        self.follow(step);
        let range = *self.range.get_or_insert_with(|| GreyRange::of(step.frame));
        let mut picture = range.picture(step.frame);
        if self.overlay.enlargement > 1 {
            picture = picture.enlarged(self.overlay.enlargement);
        }
        for (index, (state, path)) in step.states.iter().zip(&mut self.paths).enumerate() {
            self.overlay.draw(&mut picture, index + 1, state, path.make_contiguous());
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
