//! Saving the filter's state and going on from it, bit for bit.
//!
//! One format, `.npz`: a text `header` (JSON: version, precision, sizes, options), `status` of every site (0
//! where there is a filter, else the code of [`Status`]), `mean` `(filters, 12)`, `root` `(filters, 78)`
//! (lower triangles of the covariance's root, row by row, the state in the order of the options),
//! `noise_scale` `(filters, 1)` and, where there is one, `mask` `(height, width)`. numpy can read it.

use super::{
    flow_filter::FlowFilter, kernel::N, kernel::PACKED, kernel::SCALE, kernel::packed, options::FlowFilterOptions,
};
use crate::error::{Error, Result, shape_text};
use crate::io::Element;
use crate::io::npz::{NpzReader, NpzWriter};
use crate::simd::SimdReal;
use crate::types::{Frame, Status};
use serde::{Deserialize, Serialize};
use std::io::{Cursor, Read, Seek, Write};
use std::path::Path;

/// Rises when the meaning of a file changes.
const VERSION: u32 = 4;
const FORMAT: &str = "jacoflow flow filter";

#[derive(Serialize, Deserialize)]
struct Header {
    format: String,
    version: u32,
    precision: String,
    frame_size: (usize, usize),
    frames: usize,
    repairs: u64,
    options: FlowFilterOptions,
}

impl<T: SimdReal + Element> FlowFilter<T> {
    /// The whole filter as the bytes of an `.npz` archive: options, counts and states. Threads are left out.
    ///
    /// # Errors
    /// [`Error::Numerical`] or [`Error::Io`] when it cannot be put together, which does not happen in memory.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        let writer = NpzWriter::new(Cursor::new(Vec::new()), "filter state");
        Ok(self.write_to(writer)?.into_inner()?.into_inner())
    }

    /// The inverse of [`to_bytes`](Self::to_bytes), to the bit on the same instruction set.
    ///
    /// # Errors
    /// [`Error::Format`] for bytes that are no filter state, of another version or of another precision than
    /// `T`.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        Self::read_from(NpzReader::new(Cursor::new(bytes), "filter state")?)
    }

    /// Writes the filter into an `.npz` file, which appears only when it is complete.
    ///
    /// # Errors
    /// [`Error::Io`] when it cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        self.write_to(NpzWriter::create(path)?)?.finish()
    }

    /// Reads a filter that [`save`](Self::save) wrote.
    ///
    /// # Errors
    /// [`Error::Io`] when the file cannot be read, and those of [`from_bytes`](Self::from_bytes).
    pub fn load(path: impl AsRef<Path>) -> Result<Self> {
        Self::read_from(NpzReader::open(path)?)
    }

    fn write_to<W: Write + Seek>(&self, mut writer: NpzWriter<W>) -> Result<NpzWriter<W>> {
        let header = Header {
            format: FORMAT.into(),
            version: VERSION,
            precision: precision::<T>().into(),
            frame_size: self.frame_size,
            frames: self.frames,
            repairs: self.repairs,
            options: self.options.clone(),
        };
        let text = serde_json::to_string(&header).map_err(|e| Error::Numerical(format!("state header: {e}")))?;
        writer.text("header", &text)?;
        let filters = self.store.sites.len();
        writer.array("mean", &[filters, N], &self.store.gather(0, N))?;
        writer.array("root", &[filters, PACKED], &self.store.gather(N, PACKED))?;
        writer.array("noise_scale", &[filters, 1], &self.store.gather(SCALE, 1))?;
        let status: Vec<u8> = self.store.fixed.iter().map(|&status| status as u8).collect();
        let (width, height) = self.options.sites.shape(self.frame_size)?;
        writer.array("status", &[height, width], &status)?;
        if let Some(mask) = &self.options.mask {
            let bytes: Vec<u8> = mask.data().iter().map(|&used| u8::from(used)).collect();
            writer.array("mask", &[mask.height(), mask.width()], &bytes)?;
        }
        Ok(writer)
    }

    fn read_from<R: Read + Seek>(mut reader: NpzReader<R>) -> Result<Self> {
        let path = reader.path().to_path_buf();
        let wrong = |message: String| Error::format(&path, message);
        let header = read_header(&mut reader)?;
        let mut options = header.options;
        if header.precision != precision::<T>() {
            return Err(wrong(format!("expected a state in {}, got {}", precision::<T>(), header.precision)));
        }
        let (width, height) = header.frame_size;
        if options.mask.is_some() {
            let array = reader.array::<u8>("mask")?;
            if array.shape != [height, width] {
                let (expected, got) = (shape_text(&[height, width]), shape_text(&array.shape));
                return Err(wrong(format!("expected a mask of shape {expected}, got {got}")));
            }
            options.mask = Some(Frame::new(width, height, array.values.iter().map(|&used| used != 0).collect())?);
        }
        let mean = reader.array::<T>("mean")?;
        let root = reader.array::<T>("root")?;
        let scale = reader.array::<T>("noise_scale")?;
        // Nothing of the claimed size is allocated before the file has shown that it holds as much.
        let status = reader.array::<u8>("status")?;
        let (columns, rows) = options.sites.shape(header.frame_size).map_err(|e| wrong(e.to_string()))?;
        if status.shape != [rows, columns] {
            let (expected, got) = (shape_text(&[rows, columns]), shape_text(&status.shape));
            return Err(wrong(format!("expected a status of shape {expected}, got {got}")));
        }
        let filters = status.values.iter().map(|&code| usize::from(code == Status::Ok as u8)).sum::<usize>();
        let arrays = [("mean", &mean, N), ("root", &root, PACKED), ("noise_scale", &scale, 1)];
        for (name, array, columns) in arrays {
            if array.shape != [filters, columns] {
                let (expected, got) = (shape_text(&[filters, columns]), shape_text(&array.shape));
                return Err(wrong(format!("expected {name} of shape {expected}, got {got}")));
            }
        }
        for (name, array, columns) in arrays {
            check_numbers(name, &array.values, columns).map_err(wrong)?;
        }
        let mut filter = Self::new(header.frame_size, options).map_err(|e| wrong(e.to_string()))?;
        if filter.store.fixed.iter().zip(&status.values).any(|(&fixed, &code)| fixed as u8 != code) {
            return Err(wrong("the status does not fit the options".into()));
        }
        filter.store.scatter(0, N, &mean.values);
        filter.store.scatter(N, PACKED, &root.values);
        filter.store.scatter(SCALE, 1, &scale.values);
        filter.frames = header.frames;
        filter.repairs = header.repairs;
        Ok(filter)
    }
}

/// Refuses numbers that no filter leaves, in rows of `columns`: the next frame's squares would not be finite.
fn check_numbers<T: SimdReal>(name: &str, values: &[T], columns: usize) -> std::result::Result<(), String> {
    let square = if size_of::<T>() == 4 { f64::from(f32::MAX) } else { f64::MAX }.sqrt();
    let max = if name == "root" { square.sqrt() } else { square };
    let is_deviation = |column: usize| name == "root" && (0..N).any(|k| packed(k, k) == column);
    for (at, value) in values.iter().map(|value| value.to_f64()).enumerate() {
        let least = if is_deviation(at % columns) || name == "noise_scale" { 0.0 } else { -max };
        if !(least..=max).contains(&value) {
            return Err(format!("array '{name}' holds {value:e}, expected numbers from {least:e} to {max:e}"));
        }
    }
    Ok(())
}

/// The header, if it is one of this version.
fn read_header<R: Read + Seek>(reader: &mut NpzReader<R>) -> Result<Header> {
    let path = reader.path().to_path_buf();
    let wrong = |message: String| Error::format(&path, message);
    let text = reader.text("header")?;
    // The version is looked at before the rest, which another version may have changed.
    let value: serde_json::Value =
        serde_json::from_str(&text).map_err(|e| wrong(format!("the header is damaged: {e}")))?;
    if value["format"] != FORMAT {
        return Err(wrong(format!("expected a file of the kind '{FORMAT}', got {}", value["format"])));
    }
    if value["version"] != VERSION {
        return Err(wrong(format!("expected version {VERSION} of the state, got {}", value["version"])));
    }
    serde_json::from_value(value).map_err(|e| wrong(format!("the header is damaged: {e}")))
}

/// What a saved filter is, without its states.
#[derive(Debug, Clone, PartialEq)]
pub struct SavedFilter {
    /// Its working precision: "float32" or "float64".
    pub precision: String,
    /// Size `(width, height)` of its frames.
    pub frame_size: (usize, usize),
    /// How many frames it has taken in.
    pub frames: usize,
    /// How often a covariance was repaired.
    pub repairs: u64,
    /// The options in words and numbers, as JSON.
    pub options: String,
}

impl SavedFilter {
    /// Describes an archive that holds the state of a filter; `None` for any other archive.
    ///
    /// # Errors
    /// [`Error::Format`] when it is a damaged state or one of another version.
    pub fn describe<R: Read + Seek>(reader: &mut NpzReader<R>) -> Result<Option<Self>> {
        if !reader.contains("header") {
            return Ok(None);
        }
        let header = read_header(reader)?;
        let options =
            serde_json::to_string(&header.options).map_err(|e| Error::Numerical(format!("state header: {e}")))?;
        let Header { precision, frame_size, frames, repairs, .. } = header;
        Ok(Some(Self { precision, frame_size, frames, repairs, options }))
    }

    /// Whether an archive holds the state of a filter in double precision.
    ///
    /// # Errors
    /// Those of [`describe`](Self::describe).
    pub fn is_double<R: Read + Seek>(reader: &mut NpzReader<R>) -> Result<bool> {
        Ok(Self::describe(reader)?.is_some_and(|saved| saved.precision == precision::<f64>()))
    }
}

/// numpy's name of the working precision.
fn precision<T>() -> &'static str {
    if size_of::<T>() == 4 { "float32" } else { "float64" }
}
