//! The flow PNG of the KITTI benchmark (A. Geiger et al., "Vision meets robotics: the KITTI dataset", 2013).
//!
//! 16-bit RGB: `u = (R - 32768) / 64`, `v = (G - 32768) / 64`, valid where `B > 0`; px.

use super::{FlowImage, decode::check_size, decode::png_error, write::atomic};
use crate::error::{Error, Result};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Writes a flow PNG. Unknown flow, and flow that the format cannot hold, is marked invalid (0, 0, 0).
///
/// # Errors
/// [`Error::Io`] with the path.
pub fn write_kitti(path: impl AsRef<Path>, flow: &FlowImage) -> Result<()> {
    let path = path.as_ref();
    let mut bytes = Vec::with_capacity(6 * flow.u().len());
    for (&u, &v) in flow.u().iter().zip(flow.v()) {
        let pixel = match (encode(u), encode(v)) {
            (Some(r), Some(g)) => [r, g, 1],
            _ => [0; 3],
        };
        bytes.extend(pixel.iter().flat_map(|s| s.to_be_bytes()));
    }
    atomic(path, |file| {
        let mut encoder = png::Encoder::new(file, flow.width() as u32, flow.height() as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Sixteen);
        let written = encoder.write_header().and_then(|mut png| {
            png.write_image_data(&bytes)?;
            png.finish()
        });
        written.map_err(|e| Error::io(path, e.into()))
    })
}

/// The sample for a component of the flow; `None` outside the range.
fn encode(component: f32) -> Option<u16> {
    let sample = (f64::from(component) * 64.0 + 32768.0).round();
    (0.0..=65535.0).contains(&sample).then_some(sample as u16)
}

/// Reads a flow PNG; invalid pixels are NaN.
///
/// # Errors
/// [`Error::Io`] when it cannot be read, [`Error::Format`] when it is no 16-bit RGB PNG or damaged.
pub fn read_kitti(path: impl AsRef<Path>) -> Result<FlowImage> {
    let path = path.as_ref();
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    let mut reader = png::Decoder::new(BufReader::new(file)).read_info().map_err(|e| png_error(path, e))?;
    let info = reader.info();
    let (width, height) = (info.width as usize, info.height as usize);
    if (info.color_type, info.bit_depth) != (png::ColorType::Rgb, png::BitDepth::Sixteen) {
        let message = format!("not a flow PNG: expected 16-bit RGB, got {:?} {:?}", info.bit_depth, info.color_type);
        return Err(Error::format(path, message));
    }
    check_size(path, width, height)?;
    let (mut u, mut v) = (Vec::new(), Vec::new());
    // Row by row where the file allows, so that a small file cannot ask for a large picture.
    if info.interlaced {
        return Err(Error::format(path, "an interlaced PNG; flow PNGs are not interlaced"));
    }
    while let Some(row) = reader.next_row().map_err(|e| png_error(path, e))? {
        for p in row.data().chunks_exact(6) {
            let sample = |i: usize| u16::from_be_bytes([p[2 * i], p[2 * i + 1]]);
            let component = |i: usize| if sample(2) > 0 { (f32::from(sample(i)) - 32768.0) / 64.0 } else { f32::NAN };
            u.push(component(0));
            v.push(component(1));
        }
    }
    FlowImage::new(width, height, u, v).map_err(|_| Error::format(path, "cut off"))
}
