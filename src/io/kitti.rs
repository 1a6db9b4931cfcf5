//! The flow PNG of the KITTI benchmark (A. Geiger et al., "Vision meets robotics: the KITTI dataset", 2013).
//!
//! 16-bit RGB: `u = (R - 32768) / 64`, `v = (G - 32768) / 64`, valid where `B > 0`; px.

use super::{FlowImage, sixteen_bit_png::SixteenBitPng};
use crate::error::{Error, Result};
use std::path::Path;

const PNG: SixteenBitPng = SixteenBitPng { what: "flow", colour: png::ColorType::Rgb, colour_in_words: "RGB" };

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
    PNG.write(path, (flow.width(), flow.height()), &bytes)
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
    let (mut u, mut v) = (Vec::new(), Vec::new());
    let (width, height) = PNG.read(path, |[red, green, valid]| {
        let component = |sample: u16| if valid > 0 { (f32::from(sample) - 32768.0) / 64.0 } else { f32::NAN };
        u.push(component(red));
        v.push(component(green));
    })?;
    FlowImage::new(width, height, u, v).map_err(|_| Error::format(path, "cut off"))
}
