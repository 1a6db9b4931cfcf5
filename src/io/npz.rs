//! Named arrays in one file: numpy's `.npz`, a zip archive of `.npy` files.
//!
//! `numpy.load` reads the result without pickle: texts are stored as zero-dimensional `str_` arrays. Arrays
//! are stored uncompressed, as `numpy.savez` does, since planes of floats barely shrink; compressed archives
//! are read too. The bytes depend on the content only, not on the time of writing.

use super::npy::{Element, ElementType, NpyHeader, from_fortran_order, write_values};
use super::write::AtomicFile;
use crate::error::{Error, Result};
use crate::math::Real;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

/// Writes named arrays, one after another.
#[derive(Debug)]
pub struct NpzWriter<W: Write + Seek> {
    zip: ZipWriter<UntilError<W>>,
    path: PathBuf,
}

/// A place that says once that it failed, and pretends from then on: an archive that is dropped tries to
/// write its end, and prints that it cannot.
#[derive(Debug)]
pub struct UntilError<W> {
    place: W,
    /// Where the next byte is.
    at: u64,
    failed: bool,
}

impl<W> UntilError<W> {
    fn new(place: W) -> Self {
        Self { place, at: 0, failed: false }
    }

    fn try_to<R>(&mut self, pretended: R, act: impl FnOnce(&mut W) -> io::Result<R>) -> io::Result<R> {
        if self.failed {
            return Ok(pretended);
        }
        let result = act(&mut self.place);
        self.failed = result.as_ref().is_err_and(|error| error.kind() != io::ErrorKind::Interrupted);
        result
    }
}

impl<W: Write> Write for UntilError<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.try_to(bytes.len(), |place| place.write(bytes))?;
        self.at += count as u64;
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.try_to((), Write::flush)
    }
}

impl<W: Seek> Seek for UntilError<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let pretended = match to {
            SeekFrom::Start(place) => place,
            SeekFrom::Current(by) | SeekFrom::End(by) => self.at.saturating_add_signed(by),
        };
        self.at = self.try_to(pretended, |place| place.seek(to))?;
        Ok(self.at)
    }
}

/// The error of the system, with its code, where it is one.
fn io_error(error: ZipError) -> io::Error {
    match error {
        ZipError::Io(error) => error,
        other => other.into(),
    }
}

impl NpzWriter<AtomicFile> {
    /// A file that appears under its name when [`NpzWriter::finish`] is called.
    pub fn create(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        Ok(Self::new(AtomicFile::create(path)?, path))
    }

    /// Ends the archive and gives the file its name.
    ///
    /// # Errors
    /// [`Error::Io`] when the rest cannot be written.
    pub fn finish(self) -> Result<()> {
        self.into_inner()?.commit()
    }
}

impl<W: Write + Seek> NpzWriter<W> {
    /// An archive in any seekable place; `name` stands for it in messages.
    pub fn new(place: W, name: impl AsRef<Path>) -> Self {
        Self { zip: ZipWriter::new(UntilError::new(place)), path: name.as_ref().to_path_buf() }
    }

    /// Adds an array in C order.
    ///
    /// # Errors
    /// [`Error::Argument`] when `values` does not fill `shape`; [`Error::Io`] when it cannot be written.
    pub fn array<T: Element>(&mut self, name: &str, shape: &[usize], values: &[T]) -> Result<()> {
        let header = NpyHeader::new(T::TYPE, shape);
        if header.count() != Some(values.len()) {
            return Err(Error::argument(
                "values",
                format!("as many as the shape {} holds", header.shown()),
                values.len(),
            ));
        }
        self.array_from(name, &header, |out| write_values(values, out))
    }

    /// Adds an array whose data `write` puts out, exactly as many bytes as `header` says, little-endian.
    ///
    /// # Errors
    /// [`Error::Io`] when it cannot be written.
    pub fn array_from(
        &mut self,
        name: &str,
        header: &NpyHeader,
        write: impl FnOnce(&mut ZipWriter<UntilError<W>>) -> io::Result<()>,
    ) -> Result<()> {
        // Beyond 4 GiB an entry needs the 64-bit form, which must be announced.
        let large = header.byte_count().is_none_or(|n| n >= (u32::MAX - 4096) as usize);
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored).large_file(large);
        let zip = &mut self.zip;
        let written = zip.start_file(format!("{name}.npy"), options).map_err(io_error).and_then(|()| {
            header.write(zip, 0)?;
            write(zip)
        });
        written.map_err(|e| Error::io(&self.path, e))
    }

    /// Adds a text.
    ///
    /// # Errors
    /// [`Error::Io`] when it cannot be written.
    pub fn text(&mut self, name: &str, text: &str) -> Result<()> {
        let characters: Vec<u32> = text.chars().map(u32::from).collect();
        let header = NpyHeader::new(ElementType::Text(characters.len()), &[]);
        self.array_from(name, &header, |out| write_values(&characters, out))
    }

    /// Ends the archive and returns the place it was written to.
    ///
    /// # Errors
    /// [`Error::Io`] when the rest cannot be written.
    pub fn into_inner(self) -> Result<W> {
        self.zip.finish().map(|whole| whole.place).map_err(|e| Error::io(&self.path, io_error(e)))
    }
}

/// An array with its shape, in C order.
#[derive(Debug, Clone, PartialEq)]
pub struct NpyArray<T> {
    /// Length of each axis.
    pub shape: Vec<usize>,
    /// The values, last axis fastest.
    pub values: Vec<T>,
}

/// Reads named arrays in any order.
#[derive(Debug)]
pub struct NpzReader<R: Read + Seek> {
    zip: ZipArchive<R>,
    path: PathBuf,
}

impl NpzReader<BufReader<File>> {
    /// Opens a file.
    ///
    /// # Errors
    /// [`Error::Io`] when it cannot be read, [`Error::Format`] when it is no zip archive.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let file = File::open(path).map_err(|e| Error::io(path, e))?;
        if file.metadata().is_ok_and(|m| m.is_dir()) {
            return Err(Error::io(path, io::Error::from(io::ErrorKind::IsADirectory)));
        }
        Self::new(BufReader::with_capacity(1 << 18, file), path)
    }
}

impl<R: Read + Seek> NpzReader<R> {
    /// Opens an archive in any seekable place; `name` stands for it in messages.
    ///
    /// # Errors
    /// [`Error::Format`] when it is no zip archive.
    pub fn new(place: R, name: impl AsRef<Path>) -> Result<Self> {
        let path = name.as_ref().to_path_buf();
        let zip = ZipArchive::new(place).map_err(|e| zip_error(&path, e))?;
        Ok(Self { zip, path })
    }

    /// What stands for the archive in messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Names of the arrays, sorted.
    pub fn names(&self) -> Vec<String> {
        let names = self.zip.file_names().filter_map(std::result::Result::ok);
        let mut names: Vec<_> = names.filter_map(|n| n.strip_suffix(".npy").map(str::to_string)).collect();
        names.sort();
        names
    }

    /// Whether there is an array of this name.
    pub fn contains(&self, name: &str) -> bool {
        self.names().iter().any(|n| n == name)
    }

    /// The array `name`, which must have elements of type `T`.
    ///
    /// # Errors
    /// [`Error::Format`] when it is missing, damaged (each array has a checksum) or of another type.
    pub fn array<T: Element>(&mut self, name: &str) -> Result<NpyArray<T>> {
        let (header, bytes) = self.read(name)?;
        if header.element != T::TYPE {
            return Err(self.wrong(
                name,
                &format!("has elements '{}', expected '{}'", header.element.descriptor(), T::TYPE.descriptor()),
            ));
        }
        Ok(decode(&header, &bytes))
    }

    /// The array `name` of float32 or float64, in working precision.
    pub fn real_array<T: Real>(&mut self, name: &str) -> Result<NpyArray<T>> {
        let (header, bytes) = self.read(name)?;
        match header.element {
            ElementType::F32 => Ok(convert(decode::<f32>(&header, &bytes))),
            ElementType::F64 => Ok(convert(decode::<f64>(&header, &bytes))),
            other => Err(self.wrong(name, &format!("has elements '{}', expected '<f4' or '<f8'", other.descriptor()))),
        }
    }

    /// The text `name`.
    ///
    /// # Errors
    /// [`Error::Format`] when it is missing or no single text.
    pub fn text(&mut self, name: &str) -> Result<String> {
        let (header, bytes) = self.read(name)?;
        if !matches!(header.element, ElementType::Text(_)) || header.count() != Some(1) {
            return Err(self.wrong(name, "is not a single text"));
        }
        let text: Option<String> = u32::decode(&bytes, header.big_endian).into_iter().map(char::from_u32).collect();
        // numpy pads texts with NUL.
        text.map(|t| t.trim_end_matches('\0').to_string()).ok_or_else(|| self.wrong(name, "is not valid text"))
    }

    fn read(&mut self, name: &str) -> Result<(NpyHeader, Vec<u8>)> {
        let path = self.path.clone();
        let wrong = |what: String| Error::format(&path, format!("array '{name}' {what}"));
        let mut entry = match self.zip.by_name(&format!("{name}.npy")) {
            Ok(entry) => entry,
            Err(ZipError::FileNotFound) => return Err(wrong("is missing".into())),
            Err(error) => return Err(zip_error(&path, error)),
        };
        let (header, _) = NpyHeader::read(&mut entry).map_err(|e| wrong(format!("is damaged: {e}")))?;
        let expected =
            header.byte_count().ok_or_else(|| wrong(format!("has an impossible shape {}", header.shown())))?;
        // Grown as the bytes come: what the header claims is not taken on trust.
        let mut bytes = Vec::new();
        let damaged = |e| wrong(format!("is damaged: {e}"));
        entry.by_ref().take(expected as u64).read_to_end(&mut bytes).map_err(damaged)?;
        if bytes.len() < expected {
            return Err(wrong(format!("is cut off: {} of {expected} bytes", bytes.len())));
        }
        // The checksum is compared when the end is met, which the array's own length does not reach.
        if entry.read(&mut [0]).map_err(damaged)? > 0 {
            return Err(wrong(format!("goes on after its {expected} bytes")));
        }
        Ok((header, bytes))
    }

    pub(crate) fn wrong(&self, name: &str, what: &str) -> Error {
        Error::format(&self.path, format!("array '{name}' {what}"))
    }
}

fn decode<T: Element>(header: &NpyHeader, bytes: &[u8]) -> NpyArray<T> {
    let values = T::decode(bytes, header.big_endian);
    let values = if header.fortran_order { from_fortran_order(&values, &header.shape) } else { values };
    NpyArray { shape: header.shape.clone(), values }
}

fn convert<S: Real, T: Real>(array: NpyArray<S>) -> NpyArray<T> {
    NpyArray { shape: array.shape, values: array.values.into_iter().map(|v| T::from_f64(v.to_f64())).collect() }
}

fn zip_error(path: &Path, error: ZipError) -> Error {
    match error {
        ZipError::Io(e)
            if !matches!(
                e.kind(),
                io::ErrorKind::UnexpectedEof | io::ErrorKind::InvalidData | io::ErrorKind::InvalidInput
            ) =>
        {
            Error::io(path, e)
        }
        other => Error::format(path, format!("not a usable .npz archive: {other}")),
    }
}
