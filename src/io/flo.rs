//! `.flo`: the flow format of the Middlebury benchmark (S. Baker et al., "A database and evaluation
//! methodology for optical flow", 2011).
//!
//! Little-endian: float32 202021.25, int32 width, int32 height, then `u, v` interleaved row by row.

use super::FlowImage;
use super::decode::check_size;
use super::write::atomic_io;
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
    let side = |bytes| usize::try_from(i32::from_le_bytes(bytes)).unwrap_or(0);
    let (width, height) = (side(width), side(height));
    check_size(path, width, height)?;
    let (needed, mut data) = (8 * width * height, Vec::new());
    file.take(needed as u64).read_to_end(&mut data).map_err(|e| Error::io(path, e))?;
    if data.len() < needed {
        return Err(Error::format(path, format!("cut off: {} of {needed} bytes of flow", data.len())));
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn bytes_are_those_of_the_format() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.flo");
        write_flo(&path, &FlowImage::new(2, 1, vec![1.5, f32::NAN], vec![-2.0, 0.0]).unwrap()).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert_eq!(&bytes[..12], b"PIEH\x02\0\0\0\x01\0\0\0");
        let numbers: Vec<f32> = bytes[12..].chunks(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
        assert_eq!(numbers, [1.5, -2.0, 1e10, 1e10]);
        let back = read_flo(&path).unwrap();
        assert!(back.u()[0] == 1.5 && back.v()[0] == -2.0 && back.u()[1].is_nan() && back.v()[1].is_nan());
    }

    #[test]
    fn broken_files_are_format_errors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.flo");
        write_flo(&path, &FlowImage::new(3, 2, vec![0.0; 6], vec![0.0; 6]).unwrap()).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for cut in [0, 3, 11, 12, 50] {
            std::fs::write(&path, &whole[..cut]).unwrap();
            assert!(matches!(read_flo(&path), Err(Error::Format { .. })), "{cut}");
        }
        for size in [[0u8; 8], [0xff; 8], [0xff, 0xff, 0, 0, 0xff, 0xff, 0, 0]] {
            std::fs::write(&path, [&whole[..4], &size, &whole[12..]].concat()).unwrap();
            assert!(matches!(read_flo(&path), Err(Error::Format { .. })), "{size:?}");
        }
        assert!(matches!(read_flo(folder.path().join("none.flo")), Err(Error::Io { .. })));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn flow_round_trips_and_random_bytes_do_no_harm(width in 1usize..9, height in 1usize..9, seed: u32, random in proptest::collection::vec(any::<u8>(), 0..60)) {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("a.flo");
            let u: Vec<f32> = (0..width * height).map(|i| f32::from_bits((seed >> 9) | 0x4000_0000) + i as f32).collect();
            let flow = FlowImage::new(width, height, u.clone(), u).unwrap();
            write_flo(&path, &flow).unwrap();
            prop_assert_eq!(read_flo(&path).unwrap(), flow);
            std::fs::write(&path, &random).unwrap();
            prop_assert!(read_flo(&path).is_err());
            std::fs::write(&path, [b"PIEH", &random[..]].concat()).unwrap();
            let _ = read_flo(&path);
        }
    }
}
