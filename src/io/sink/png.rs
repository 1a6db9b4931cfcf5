//! Numbered PNG files in a folder.

use super::{FrameSink, Kind, Uniform};
use crate::error::{Error, Result};
use crate::io::write::{NewFolders, TemporaryFolder};
use crate::io::{NumberedFiles, write_colour_png, write_frame_png};
use crate::types::{AnyColourFrame, AnyFrame};
use std::path::{Path, PathBuf};

pub(super) const KIND: Kind = Kind {
    accepts: |spec| spec.ends_with('/') || Path::new(spec).is_dir() || Path::new(spec).extension().is_none(),
    open: |spec, _| Ok(Box::new(PngSink::create(spec)?)),
    open_colour: |spec, _| Ok(Box::new(PngSink::create(spec)?)),
};

/// Writes frames as `frame_000000.png`, ... of 8 or 16 bit. They get into the folder together, when the last
/// is written, and replace those of an earlier sink.
#[derive(Debug)]
pub struct PngSink {
    folder: PathBuf,
    waiting: TemporaryFolder,
    /// Dropped after `waiting`, which lies inside.
    _made: NewFolders,
    files: NumberedFiles,
    next: usize,
    uniform: Uniform,
}

impl PngSink {
    /// Files in `folder`, which is made when it does not exist, and removed again when none get there.
    pub fn create(folder: impl AsRef<Path>) -> Result<Self> {
        let folder = folder.as_ref();
        let made = NewFolders::before([folder]);
        std::fs::create_dir_all(folder).map_err(|error| Error::io(folder, error))?;
        let waiting = TemporaryFolder::inside(folder)?;
        let files = numbered(waiting.path())?;
        Ok(Self { folder: folder.to_path_buf(), waiting, _made: made, files, next: 0, uniform: Uniform::default() })
    }

    fn place(self) -> Result<()> {
        let placed = numbered(&self.folder)?;
        placed.clear()?;
        for index in 0..self.next {
            let path = placed.path(index);
            std::fs::rename(self.files.path(index), &path).map_err(|error| Error::io(&path, error))?;
        }
        drop(self.waiting);
        Ok(())
    }
}

fn numbered(folder: &Path) -> Result<NumberedFiles> {
    NumberedFiles::create(folder, "frame", "png")
}

impl FrameSink for PngSink {
    fn write(&mut self, frame: &AnyFrame) -> Result<()> {
        self.uniform.check(frame)?;
        write_frame_png(self.files.path(self.next), frame)?;
        self.next += 1;
        Ok(())
    }
    fn finish(self: Box<Self>) -> Result<()> {
        self.place()
    }
}

impl FrameSink<AnyColourFrame> for PngSink {
    fn write(&mut self, frame: &AnyColourFrame) -> Result<()> {
        self.uniform.check(frame)?;
        write_colour_png(self.files.path(self.next), frame)?;
        self.next += 1;
        Ok(())
    }
    fn finish(self: Box<Self>) -> Result<()> {
        self.place()
    }
}
