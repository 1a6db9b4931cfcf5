//! Pictures and frames as PNG, whole or not at all.

use super::write::atomic;
use crate::error::{Error, Result};
use crate::image::picture::Picture;
use crate::types::{AnyColourFrame, AnyFrame};
use std::path::Path;

/// Writes a picture as an 8-bit RGB PNG.
///
/// # Errors
/// [`Error::Argument`] named `picture` for an empty one; [`Error::Io`] with the path.
pub fn write_picture(path: impl AsRef<Path>, picture: &Picture) -> Result<()> {
    let size = (picture.width(), picture.height());
    write_png(path.as_ref(), size, png::ColorType::Rgb, png::BitDepth::Eight, picture.data())
}

/// Writes a frame as a grey PNG: 8 bit for uint8, 16 bit for uint16.
///
/// # Errors
/// [`Error::Type`] named `frame` for float samples, which PNG cannot hold; [`Error::Argument`] for an empty
/// frame; [`Error::Io`] with the path.
pub fn write_frame_png(path: impl AsRef<Path>, frame: &AnyFrame) -> Result<()> {
    let path = path.as_ref();
    match frame {
        AnyFrame::U8(f) => write_png(path, f.size(), png::ColorType::Grayscale, png::BitDepth::Eight, f.data()),
        AnyFrame::U16(f) => {
            write_png(path, f.size(), png::ColorType::Grayscale, png::BitDepth::Sixteen, &big_endian(f.data()))
        }
        AnyFrame::F32(_) | AnyFrame::F64(_) => Err(refuse_floats(frame.dtype())),
    }
}

/// Writes a colour frame as an RGB PNG: 8 bit for uint8, 16 bit for uint16.
pub fn write_colour_png(path: impl AsRef<Path>, frame: &AnyColourFrame) -> Result<()> {
    let path = path.as_ref();
    match frame {
        AnyColourFrame::U8(f) => {
            write_png(path, f.size(), png::ColorType::Rgb, png::BitDepth::Eight, f.data().as_flattened())
        }
        AnyColourFrame::U16(f) => {
            let bytes = big_endian(f.data().as_flattened());
            write_png(path, f.size(), png::ColorType::Rgb, png::BitDepth::Sixteen, &bytes)
        }
        AnyColourFrame::F32(_) | AnyColourFrame::F64(_) => Err(refuse_floats(frame.dtype())),
    }
}

fn big_endian(samples: &[u16]) -> Vec<u8> {
    samples.iter().flat_map(|sample| sample.to_be_bytes()).collect()
}

fn refuse_floats(dtype: &str) -> Error {
    let expected = "uint8 or uint16 samples for PNG (floats go to .npy)".into();
    Error::Type { argument: "frame", expected, got: dtype.into() }
}

fn write_png(
    path: &Path,
    (width, height): (usize, usize),
    colour: png::ColorType,
    depth: png::BitDepth,
    bytes: &[u8],
) -> Result<()> {
    let sides = (u32::try_from(width).ok().filter(|w| *w > 0), u32::try_from(height).ok().filter(|h| *h > 0));
    let (Some(w), Some(h)) = sides else {
        return Err(Error::argument("picture", "at least one pixel", format!("{width} x {height}")));
    };
    atomic(path, |file| {
        let mut encoder = png::Encoder::new(file, w, h);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        encoder.set_compression(png::Compression::Fast);
        let written = encoder.write_header().and_then(|mut png| {
            png.write_image_data(bytes)?;
            png.finish()
        });
        written.map_err(|e| Error::io(path, e.into()))
    })
}
