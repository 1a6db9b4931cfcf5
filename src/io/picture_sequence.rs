//! Pictures as a sequence: colour YUV4MPEG2, which players and encoders read.

use super::{sink::eight_bit_planes, sink::ratio, write::AtomicFile};
use crate::error::{Error, Result};
use crate::image::picture::Picture;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Writes pictures of one size as `C444`, full range, by the matrix of ITU-R BT.601 as JPEG has it.
#[derive(Debug)]
pub struct SequenceWriter {
    file: AtomicFile,
    path: PathBuf,
    rate: (u64, u64),
    size: Option<(usize, usize)>,
}

impl SequenceWriter {
    /// Begins a file, which appears under its name when it is finished. `frame_rate`: frames per second.
    ///
    /// # Errors
    /// As [`AtomicFile::create`]; [`Error::Argument`] named `frame_rate` unless that is positive and a ratio
    /// of 32-bit numbers.
    pub fn create(path: impl AsRef<Path>, frame_rate: f64) -> Result<Self> {
        if !(frame_rate > 0.0 && frame_rate.is_finite()) {
            return Err(Error::argument("frame_rate", "a positive number of frames per second", frame_rate));
        }
        let (path, rate) = (path.as_ref(), ratio(frame_rate)?);
        Ok(Self { file: AtomicFile::create(path)?, path: path.to_path_buf(), rate, size: None })
    }

    /// Adds a picture.
    ///
    /// # Errors
    /// [`Error::Argument`] named `picture` for another size than the first one's; [`Error::Io`] with the
    /// path.
    pub fn write(&mut self, picture: &Picture) -> Result<()> {
        let size @ (width, height) = (picture.width(), picture.height());
        let ((a, b), is_first) = (self.rate, self.size.is_none());
        let wanted = *self.size.get_or_insert(size);
        if size != wanted {
            let expected = format!("{} x {} px, as the first", wanted.0, wanted.1);
            return Err(Error::argument("picture", expected, format!("{width} x {height} px")));
        }
        let mut bytes = Vec::with_capacity(3 * width * height + 128);
        if is_first {
            let header = format!("YUV4MPEG2 W{width} H{height} F{a}:{b} Ip A1:1 C444 XCOLORRANGE=FULL\n");
            bytes.extend_from_slice(header.as_bytes());
        }
        bytes.extend_from_slice(b"FRAME\n");
        bytes.extend(eight_bit_planes(picture.data().as_chunks::<3>().0));
        self.file.write_all(&bytes).map_err(|e| Error::io(&self.path, e))
    }

    /// Gives the file its name.
    pub fn finish(self) -> Result<()> {
        self.file.commit()
    }

    /// As [`SequenceWriter::finish`], under another name in the same folder.
    pub fn finish_as(self, path: impl AsRef<Path>) -> Result<()> {
        self.file.commit_as(path)
    }
}
