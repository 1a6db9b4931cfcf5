//! Tracks over the frames, as pictures or a sequence.

use super::TrackStep;
use crate::error::Result;
use crate::image::{picture::GreyRange, picture::PathPoint, picture::Picture, picture::TrackOverlay};
use crate::pipeline::album::Album;
use crate::pipeline::sink::{Sink, ends_as};
use crate::types::TrackState;
use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};

/// How many frames of a path are drawn: memory and time of a frame stay bounded.
pub const PATH_LENGTH: usize = 1000;

/// First word of the files' names.
const STEM: &str = "track";

/// Writes every frame with its targets as `track_000012.png`, numbered as in the input, or a sequence.
#[derive(Debug)]
pub struct Overlays {
    pub(in crate::pipeline) album: Album,
    pub(in crate::pipeline) overlay: TrackOverlay,
    pub(in crate::pipeline) range: Option<GreyRange>,
    /// By the targets' numbers.
    paths: BTreeMap<u64, VecDeque<PathPoint>>,
}

impl Overlays {
    /// Pictures in a folder, which is made when it does not exist, or, by the name `*.y4m`, a sequence of
    /// `frame_rate` frames per second that appears when it is finished.
    pub fn create(path: impl AsRef<Path>, overlay: TrackOverlay, frame_rate: f64) -> Result<Self> {
        let album = Album::create(path.as_ref(), STEM, "overlay", frame_rate)?;
        Ok(Self { album, overlay, range: None, paths: BTreeMap::new() })
    }

    /// Refuses a folder that holds pictures of an earlier run, and a sequence that exists. Makes nothing.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) named `overlay`.
    pub fn check(path: &Path) -> Result<()> {
        Album::check(path, STEM, "overlay")
    }

    /// Writes a frame with the targets of these numbers and their paths.
    pub(in crate::pipeline) fn draw<'a>(
        &mut self,
        frame_index: usize,
        mut picture: Picture,
        targets: impl Iterator<Item = (u64, &'a TrackState)>,
    ) -> Result<()> {
        if self.overlay.enlargement > 1 {
            picture = picture.enlarged(self.overlay.enlargement);
        }
        for (number, state) in targets {
            let path = self.paths.entry(number).or_default();
            if path.len() == PATH_LENGTH {
                path.pop_front();
            }
            path.push_back((state.position, state.status));
            self.overlay.draw(&mut picture, number as usize, state, path.make_contiguous());
        }
        self.album.add(frame_index, &picture)
    }
}

impl Sink<TrackStep<'_>> for Overlays {
    fn accept(&mut self, step: &TrackStep<'_>) -> Result<()> {
        let range = *self.range.get_or_insert_with(|| GreyRange::of(step.frame));
        self.draw(step.frame_index, range.picture(step.frame), (1..).zip(step.states))
    }

    ends_as!(album);
}
