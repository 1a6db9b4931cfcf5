//! `.flo`: the flow format of the Middlebury benchmark (S. Baker et al., "A database and evaluation
//! methodology for optical flow", 2011).
//!
//! Little-endian: float32 202021.25, int32 width, int32 height, then `u, v` interleaved row by row.

use super::{FlowImage, limits::check_size, write::atomic_io};
use crate::error::{Error, Result};
use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;

/// First number of the file; its bytes read `PIEH`.
const TAG: f32 = 202_021.25;
/// What unknown flow is written as, and the limit above which it is recognised.
const UNKNOWN: f32 = 1e10;
const UNKNOWN_ABOVE: f32 = 1e9;

/// Writes a `.flo` file; unknown flow as 1e10.
///
/// # Errors
/// [`Error::Io`] with the path.
pub fn write_flo(path: impl AsRef<Path>, flow: &FlowImage) -> Result<()> {
    let mut bytes = Vec::with_capacity(12 + 8 * flow.u().len());
    bytes.extend(TAG.to_le_bytes());
    bytes.extend((flow.width() as i32).to_le_bytes());
    bytes.extend((flow.height() as i32).to_le_bytes());
    for (&u, &v) in flow.u().iter().zip(flow.v()) {
        let (u, v) = if u.is_finite() && v.is_finite() { (u, v) } else { (UNKNOWN, UNKNOWN) };
        bytes.extend(u.to_le_bytes());
        bytes.extend(v.to_le_bytes());
    }
    atomic_io(path.as_ref(), |file| file.write_all(&bytes))
}

/// Reads a `.flo` file; flow beyond 1e9 in either component is unknown (NaN in both).
///
/// # Errors
/// [`Error::Io`] when it cannot be read, [`Error::Format`] when it is no such file or cut off.
pub fn read_flo(path: impl AsRef<Path>) -> Result<FlowImage> {
    let path = path.as_ref();
    let mut file = File::open(path).map_err(|e| Error::io(path, e))?;
    let mut head = Vec::new();
    (&mut file).take(12).read_to_end(&mut head).map_err(|e| Error::io(path, e))?;
    let word = |i: usize| head.get(4 * i..4 * i + 4).map(|b| [b[0], b[1], b[2], b[3]]);
    let (Some(tag), Some(width), Some(height)) = (word(0), word(1), word(2)) else {
        return Err(Error::format(path, "not a .flo file (shorter than its header)"));
    };
    if f32::from_le_bytes(tag) != TAG {
        return Err(Error::format(path, "not a .flo file (its first number is not 202021.25)"));
    }
    let sides = [width, height].map(i32::from_le_bytes);
    let [Ok(width), Ok(height)] = sides.map(usize::try_from) else {
        return Err(Error::format(path, format!("a field of {} x {} px", sides[0], sides[1])));
    };
    check_size(path, width, height)?;
    let (needed, mut data) = (8 * width * height, Vec::new());
    // One byte more shows a header that does not fit.
    file.take(needed as u64 + 1).read_to_end(&mut data).map_err(|e| Error::io(path, e))?;
    if data.len() < needed {
        return Err(Error::format(path, format!("cut off: {} of {needed} bytes of flow", data.len())));
    }
    if data.len() > needed {
        return Err(Error::format(path, format!("longer than a field of {width} x {height} px, as its header says")));
    }
    let known = |(u, v): (f32, f32)| {
        let good = u.abs() <= UNKNOWN_ABOVE && v.abs() <= UNKNOWN_ABOVE;
        if good { (u, v) } else { (f32::NAN, f32::NAN) }
    };
    let pairs = data
        .chunks_exact(8)
        .map(|b| known((f32::from_le_bytes([b[0], b[1], b[2], b[3]]), f32::from_le_bytes([b[4], b[5], b[6], b[7]]))));
    let (u, v) = pairs.unzip();
    FlowImage::new(width, height, u, v)
}
