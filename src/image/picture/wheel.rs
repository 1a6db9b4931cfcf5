//! Flow as colour: direction is hue, speed is saturation.

use super::{Picture, Rgb, check_plane, percentile};
use crate::error::Result;
use crate::math::Real;

/// How many hues lie between neighbouring corners of the wheel (red, yellow, green, cyan, blue, magenta,
/// red), chosen so that perceived hue changes evenly (S. Baker et al., "A database and evaluation methodology
/// for optical flow", 2011).
const STEPS: [(usize, Rgb); 6] = [
    (15, [255, 0, 0]),
    (6, [255, 255, 0]),
    (4, [0, 255, 0]),
    (11, [0, 255, 255]),
    (13, [0, 0, 255]),
    (6, [255, 0, 255]),
];

/// The colour wheel of the Middlebury flow pages: rest is white, right is red, down is yellow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlowColours {
    /// Speed of full saturation, px/frame; `None`: the given percentile of the speeds. Faster is darker.
    pub max_speed: Option<f64>,
    /// Percentile of the automatic range; default 99.
    pub percentile: f64,
    /// Colour of unknown (NaN or infinite) flow; default black.
    pub unknown: Rgb,
}

impl Default for FlowColours {
    fn default() -> Self {
        Self { max_speed: None, percentile: 99.0, unknown: [0, 0, 0] }
    }
}

impl FlowColours {
    /// Colours with a fixed (`Some`) or automatic range.
    pub fn new(max_speed: Option<f64>) -> Self {
        Self { max_speed, ..Self::default() }
    }

    /// The speed of full saturation for this flow: `max_speed`, else the percentile; 1 at rest.
    pub fn range<T: Real>(&self, u: &[T], v: &[T]) -> f64 {
        let speeds = u.iter().zip(v).map(|(u, v)| u.to_f64().hypot(v.to_f64()));
        let range = self.max_speed.unwrap_or_else(|| percentile(speeds, self.percentile));
        if range > 0.0 && range.is_finite() { range } else { 1.0 }
    }

    /// A picture of the flow planes `u`, `v` (row-major, `width x height`).
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) when a plane has another size.
    pub fn picture<T: Real>(&self, u: &[T], v: &[T], width: usize, height: usize) -> Result<Picture> {
        check_plane("u", u, width, height)?;
        check_plane("v", v, width, height)?;
        let (wheel, range) = (wheel(), self.range(u, v));
        Ok(Picture::from_fn(width, height, |x, y| {
            let at = y * width + x;
            colour(&wheel, u[at].to_f64() / range, v[at].to_f64() / range).unwrap_or(self.unknown)
        }))
    }
}

/// The 55 hues, from red through yellow, green, cyan, blue and magenta.
fn wheel() -> Vec<[f64; 3]> {
    let mut hues = Vec::with_capacity(55);
    for (corner, &(steps, from)) in STEPS.iter().enumerate() {
        let to = STEPS[(corner + 1) % STEPS.len()].1;
        for step in 0..steps {
            let part = step as f64 / steps as f64;
            hues.push(std::array::from_fn(|c| (f64::from(from[c]) * (1.0 - part) + f64::from(to[c]) * part) / 255.0));
        }
    }
    hues
}

/// Colour of a flow in units of the full speed; `None` for unknown flow.
fn colour(wheel: &[[f64; 3]], u: f64, v: f64) -> Option<Rgb> {
    let speed = u.hypot(v);
    if !speed.is_finite() {
        return None;
    }
    // A turn of the flow runs once through the hues; at red, to the right, the angle jumps by a turn.
    let turn = (-v).atan2(-u) / std::f64::consts::TAU + 0.5;
    let place = turn * (wheel.len() - 1) as f64;
    let first = (place as usize).min(wheel.len() - 1);
    let (a, b, part) = (wheel[first], wheel[(first + 1) % wheel.len()], place - first as f64);
    Some(std::array::from_fn(|c| {
        let hue = a[c] * (1.0 - part) + b[c] * part;
        let value = if speed <= 1.0 { 1.0 - speed * (1.0 - hue) } else { 0.75 * hue };
        (255.0 * value).floor() as u8
    }))
}
