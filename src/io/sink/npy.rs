//! A `.npy` stack `(T, H, W)`, of colour `(T, H, W, 3)`, of any number of frames.

use super::{FrameSink, Kind, Uniform};
use crate::error::{Error, Result};
use crate::io::npy::{Element, ElementType, NpyHeader, write_values};
use crate::io::write::AtomicFile;
use crate::types::{AnyColourFrame, AnyFrame};
use std::io::{Seek, SeekFrom};
use std::path::{Path, PathBuf};

pub(super) const KIND: Kind = Kind {
    accepts: |spec| Path::new(spec).extension().is_some_and(|e| e.eq_ignore_ascii_case("npy")),
    open: |spec, _| Ok(Box::new(NpySink::create(spec)?)),
    open_colour: |spec, _| Ok(Box::new(NpySink::create(spec)?)),
};

/// Bytes kept for the header: the number of frames is filled in at the end.
const HEADER_BYTES: usize = 192;

/// Writes frames to a stack; the file appears under its name when it is finished.
#[derive(Debug)]
pub struct NpySink {
    path: PathBuf,
    file: AtomicFile,
    header: NpyHeader,
    uniform: Uniform,
}

impl NpySink {
    /// Begins a stack.
    pub fn create(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref().to_path_buf();
        let header = NpyHeader::new(ElementType::U8, &[0, 0, 0]);
        Ok(Self { file: AtomicFile::create(&path)?, path, header, uniform: Uniform::default() })
    }

    /// Adds a frame of `channels` samples a pixel (empty: grey).
    fn put<T: Element>(
        &mut self,
        first: bool,
        (width, height): (usize, usize),
        channels: &[usize],
        samples: &[T],
    ) -> Result<()> {
        let written = if first {
            self.header = NpyHeader::new(T::TYPE, &[&[0, height, width], channels].concat());
            self.header.write(&mut self.file, HEADER_BYTES)
        } else {
            Ok(())
        };
        self.header.shape[0] += 1;
        written.and_then(|()| write_values(samples, &mut self.file)).map_err(|e| Error::io(&self.path, e))
    }

    /// Writes the header again, with the number of frames, and gives the file its name.
    fn end(mut self) -> Result<()> {
        let rewritten =
            self.file.seek(SeekFrom::Start(0)).and_then(|_| self.header.write(&mut self.file, HEADER_BYTES));
        rewritten.map_err(|e| Error::io(&self.path, e))?;
        self.file.commit()
    }
}

impl FrameSink for NpySink {
    fn write(&mut self, frame: &AnyFrame) -> Result<()> {
        let first = self.uniform.check(frame)?;
        match frame {
            AnyFrame::U8(f) => self.put(first, f.size(), &[], f.data()),
            AnyFrame::U16(f) => self.put(first, f.size(), &[], f.data()),
            AnyFrame::F32(f) => self.put(first, f.size(), &[], f.data()),
            AnyFrame::F64(f) => self.put(first, f.size(), &[], f.data()),
        }
    }
    fn finish(self: Box<Self>) -> Result<()> {
        self.end()
    }
}

impl FrameSink<AnyColourFrame> for NpySink {
    fn write(&mut self, frame: &AnyColourFrame) -> Result<()> {
        let first = self.uniform.check(frame)?;
        match frame {
            AnyColourFrame::U8(f) => self.put(first, f.size(), &[3], f.data().as_flattened()),
            AnyColourFrame::U16(f) => self.put(first, f.size(), &[3], f.data().as_flattened()),
            AnyColourFrame::F32(f) => self.put(first, f.size(), &[3], f.data().as_flattened()),
            AnyColourFrame::F64(f) => self.put(first, f.size(), &[3], f.data().as_flattened()),
        }
    }
    fn finish(self: Box<Self>) -> Result<()> {
        self.end()
    }
}
