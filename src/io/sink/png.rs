//! Numbered PNG files in a folder.

use super::{FrameSink, Kind, Uniform};
use crate::error::Result;
use crate::io::{NumberedFiles, write_colour_png, write_frame_png};
use crate::types::{AnyColourFrame, AnyFrame};
use std::path::Path;

pub(super) const KIND: Kind = Kind {
    accepts: |spec| spec.ends_with('/') || Path::new(spec).is_dir() || Path::new(spec).extension().is_none(),
    open: |spec, _| Ok(Box::new(PngSink::create(spec)?)),
    open_colour: |spec, _| Ok(Box::new(PngSink::create(spec)?)),
};

/// Writes frames as `frame_000000.png`, ... of 8 or 16 bit, each whole.
#[derive(Debug)]
pub struct PngSink {
    files: NumberedFiles,
    next: usize,
    uniform: Uniform,
}

impl PngSink {
    /// Files in `folder`, which is made when it does not exist. The first frame removes those of an earlier
    /// sink.
    pub fn create(folder: impl AsRef<Path>) -> Result<Self> {
        Ok(Self { files: NumberedFiles::create(folder, "frame", "png")?, next: 0, uniform: Uniform::default() })
    }
}

impl FrameSink for PngSink {
    fn write(&mut self, frame: &AnyFrame) -> Result<()> {
        if self.uniform.check(frame)? {
            self.files.clear()?;
        }
        write_frame_png(self.files.path(self.next), frame)?;
        self.next += 1;
        Ok(())
    }
    fn finish(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}

impl FrameSink<AnyColourFrame> for PngSink {
    fn write(&mut self, frame: &AnyColourFrame) -> Result<()> {
        if self.uniform.check(frame)? {
            self.files.clear()?;
        }
        write_colour_png(self.files.path(self.next), frame)?;
        self.next += 1;
        Ok(())
    }
    fn finish(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}
