//! Tracks over the frames, as pictures.

use super::{TrackSink, TrackStep};
use crate::error::{Error, Result};
use crate::image::picture::{GreyRange, PathPoint, TrackOverlay};
use crate::io::{NumberedFiles, write_picture};
use crate::pipeline::sink::Ending;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};

/// How many frames of a path are drawn: memory and time of a frame stay bounded.
pub const PATH_LENGTH: usize = 1000;

/// First word of the files' names.
const STEM: &str = "track";

/// Writes every frame with its targets as `track_000012.png`, numbered as in the input, each whole.
#[derive(Debug)]
pub struct Overlays {
    files: NumberedFiles,
    overlay: TrackOverlay,
    range: Option<GreyRange>,
    paths: Vec<VecDeque<PathPoint>>,
    written: usize,
    latest: Option<PathBuf>,
}

impl Overlays {
    /// Pictures in `folder`, which is made when it does not exist.
    ///
    /// # Errors
    /// As [`NumberedFiles::create`].
    pub fn create(folder: impl AsRef<Path>, overlay: TrackOverlay) -> Result<Self> {
        let files = NumberedFiles::create(folder, STEM, "png")?;
        Ok(Self { files, overlay, range: None, paths: Vec::new(), written: 0, latest: None })
    }

    /// Refuses a folder that holds pictures of an earlier run, which would end up as a mixture. Nothing is made.
    ///
    /// # Errors
    /// [`Error::Argument`] named `overlay`.
    pub fn check(folder: &Path) -> Result<()> {
        if folder.exists() && !folder.is_dir() {
            return Err(Error::argument("overlay", "a folder", folder.display()));
        }
        let entries = folder.read_dir().into_iter().flatten().flatten();
        let ours = |path: &PathBuf| {
            let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
            let number = stem.strip_prefix(STEM).and_then(|rest| rest.strip_prefix('_'));
            path.extension().is_some_and(|e| e == "png")
                && number.is_some_and(|n| n.bytes().all(|b| b.is_ascii_digit()))
        };
        match entries.map(|entry| entry.path()).find(ours) {
            Some(path) => {
                let wanted = "a place without earlier results (--force replaces them)";
                Err(Error::argument("overlay", wanted, path.display()))
            }
            None => Ok(()),
        }
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

impl TrackSink for Overlays {
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
        let file = self.files.path(step.frame_index);
        write_picture(&file, &picture)?;
        self.written += 1;
        self.latest = Some(file);
        Ok(())
    }

    fn finish(&mut self, _ending: Ending) -> Result<()> {
        Ok(())
    }

    fn files(&self) -> (usize, Option<PathBuf>) {
        (self.written, self.latest.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::{AnyFrame, Frame, TargetBox, TrackState};

    #[test]
    fn a_path_stays_bounded_and_earlier_pictures_are_not_mixed() {
        let folder = tempfile::tempdir().unwrap();
        let mut overlays = Overlays::create(folder.path(), TrackOverlay::default()).unwrap();
        let frame = AnyFrame::U8(Frame::filled(16, 16, 0));
        let states = [TrackState::at([6.0, 8.0], TargetBox::about([6.0, 8.0], 5.0, 3.0))];
        for index in 0..PATH_LENGTH + 5 {
            overlays.follow(&TrackStep { frame_index: index, time: None, frame: &frame, states: &states });
        }
        assert_eq!(overlays.paths[0].len(), PATH_LENGTH);
        overlays.accept(&TrackStep { frame_index: 3, time: None, frame: &frame, states: &states }).unwrap();
        assert!(Overlays::check(folder.path()).unwrap_err().to_string().contains("track_000003.png"));
        assert!(Overlays::check(&folder.path().join("new")).is_ok());
        assert!(Overlays::check(&folder.path().join("track_000003.png")).is_err());
    }
}
