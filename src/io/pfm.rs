//! `.pfm`, the portable float map: one or three planes of float32, rows from the bottom up.

use super::{limits::check_size, write::atomic_io};
use crate::error::{Error, Result};
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;

/// One or three planes of float32, row-major, rows from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct FloatMap {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// One plane (grey) or three (colour, or any three quantities), each of `width * height` values.
    pub planes: Vec<Vec<f32>>,
}

impl FloatMap {
    fn check(&self) -> Result<()> {
        let n = self.width.checked_mul(self.height);
        if matches!(self.planes.len(), 1 | 3) && self.planes.iter().all(|p| Some(p.len()) == n) {
            return Ok(());
        }
        let got: Vec<String> = self.planes.iter().map(|p| p.len().to_string()).collect();
        let expected = format!("1 or 3 planes of {} x {} values", self.width, self.height);
        Err(Error::argument("planes", expected, format!("{} planes of {} values", got.len(), got.join(", "))))
    }
}

/// Writes a `.pfm` file, little-endian, scale 1; NaN is kept.
///
/// # Errors
/// [`Error::Argument`] named `planes` unless there are 1 or 3 of the right size; [`Error::Io`] with the path.
pub fn write_pfm(path: impl AsRef<Path>, map: &FloatMap) -> Result<()> {
    map.check()?;
    let kind = if map.planes.len() == 1 { "Pf" } else { "PF" };
    let mut bytes = format!("{kind}\n{} {}\n-1.0\n", map.width, map.height).into_bytes();
    for y in (0..map.height).rev() {
        for x in 0..map.width {
            for plane in &map.planes {
                bytes.extend(plane[y * map.width + x].to_le_bytes());
            }
        }
    }
    atomic_io(path.as_ref(), |file| file.write_all(&bytes))
}

/// Reads a `.pfm` file of either byte order; the scale's size is ignored.
///
/// # Errors
/// [`Error::Io`] when it cannot be read, [`Error::Format`] when it is no such file or cut off.
pub fn read_pfm(path: impl AsRef<Path>) -> Result<FloatMap> {
    let path = path.as_ref();
    let mut file = BufReader::new(File::open(path).map_err(|e| Error::io(path, e))?);
    let bad = |what: &str| Error::format(path, format!("not a .pfm file: {what}"));
    let channels = match word(&mut file, path)?.as_str() {
        "Pf" => 1,
        "PF" => 3,
        _ => return Err(bad("it does not begin with Pf or PF")),
    };
    let mut side = || word(&mut file, path)?.parse::<usize>().map_err(|_| bad("its size is no number"));
    let (width, height) = (side()?, side()?);
    check_size(path, width, height)?;
    let scale: f64 = word(&mut file, path)?.parse().map_err(|_| bad("its scale is no number"))?;
    // Its sign is the byte order, which 0 and NaN do not say.
    if scale == 0.0 || !scale.is_finite() {
        return Err(bad(&format!(
            "its scale is {scale}; expected a number below 0 (little-endian) or above (big-endian)"
        )));
    }
    let (needed, mut bytes) = (4 * channels * width * height, Vec::new());
    file.take(needed as u64).read_to_end(&mut bytes).map_err(|e| Error::io(path, e))?;
    if bytes.len() < needed {
        return Err(Error::format(path, format!("cut off: {} of {needed} bytes of data", bytes.len())));
    }
    let number = if scale < 0.0 { f32::from_le_bytes } else { f32::from_be_bytes };
    let mut planes = vec![vec![0.0; width * height]; channels];
    for (i, b) in bytes.chunks_exact(4).enumerate() {
        let (channel, x, y) = (i % channels, i / channels % width, height - 1 - i / channels / width);
        planes[channel][y * width + x] = number([b[0], b[1], b[2], b[3]]);
    }
    Ok(FloatMap { width, height, planes })
}

/// The next word of the header and the one space after it.
fn word(input: &mut impl BufRead, path: &Path) -> Result<String> {
    let mut text = String::new();
    for byte in input.take(64).bytes() {
        match byte.map_err(|e| Error::io(path, e))? {
            b if b.is_ascii_whitespace() && text.is_empty() => {}
            b if b.is_ascii_whitespace() => return Ok(text),
            b => text.push(char::from(b)),
        }
    }
    Err(Error::format(path, "not a .pfm file: its header is cut off"))
}
