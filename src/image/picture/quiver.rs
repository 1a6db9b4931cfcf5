//! Flow as arrows over a picture.

use super::{Picture, Rgb, check_plane, draw::draw_stroke, percentile};
use crate::error::{Error, Result};
use crate::math::Real;

/// One arrow: flow `(u, v)` px/frame at the pixel `(x, y)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arrow {
    /// Column of the tail, px.
    pub x: f64,
    /// Row of the tail, px.
    pub y: f64,
    /// Flow along x, px/frame.
    pub u: f64,
    /// Flow along y, px/frame.
    pub v: f64,
}

/// How arrows are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quiver {
    /// Length of an arrow in frames of motion (2: twice as long as one frame's motion); `None` (the default):
    /// chosen so that the 98th percentile of the speeds is `longest` px long.
    pub scale: Option<f64>,
    /// Length of the 98th percentile's arrow under the automatic scale, px; default 14.
    pub longest: f64,
    /// Width of the strokes, px; default 1.3.
    pub thickness: f64,
    /// Colour of the arrows; default yellow, with a dark outline so that it shows on any grey.
    pub colour: Rgb,
}

impl Default for Quiver {
    fn default() -> Self {
        Self { scale: None, longest: 14.0, thickness: 1.3, colour: [255, 214, 10] }
    }
}

impl Quiver {
    /// Arrows with a fixed (`Some`) or automatic scale.
    pub fn new(scale: Option<f64>) -> Self {
        Self { scale, ..Self::default() }
    }

    /// The scale used for these arrows.
    pub fn resolve_scale(&self, arrows: &[Arrow]) -> f64 {
        self.scale.unwrap_or_else(|| {
            let speed = percentile(arrows.iter().map(|a| a.u.hypot(a.v)), 98.0);
            if speed > 0.0 { self.longest / speed } else { 1.0 }
        })
    }

    /// Draws `arrows` over `picture`: unknown flow is left out, the shortest becomes a dot.
    pub fn draw(&self, picture: &mut Picture, arrows: &[Arrow]) {
        let scale = self.resolve_scale(arrows);
        for pass in [(self.thickness + 1.6, [20, 20, 20]), (self.thickness, self.colour)] {
            for arrow in arrows.iter().filter(|a| a.u.is_finite() && a.v.is_finite()) {
                draw_arrow(picture, *arrow, scale, pass.0, pass.1);
            }
        }
    }
}

/// The shaft and the two strokes of the head, which is a third of the shaft but never over 5 px long.
fn draw_arrow(picture: &mut Picture, arrow: Arrow, scale: f64, thickness: f64, colour: Rgb) {
    let (dx, dy) = (arrow.u * scale, arrow.v * scale);
    let (tail, tip) = ((arrow.x, arrow.y), (arrow.x + dx, arrow.y + dy));
    let length = dx.hypot(dy);
    if length < 0.5 {
        draw_stroke(picture, tail, tail, thickness, colour);
        return;
    }
    draw_stroke(picture, tail, tip, thickness, colour);
    let head = (length / 3.0).min(5.0) / length;
    // The barbs point backwards, 26 degrees to either side.
    let (cos, sin) = (0.9, 0.436);
    for side in [-1.0, 1.0] {
        let barb = (tip.0 - head * (cos * dx - side * sin * dy), tip.1 - head * (cos * dy + side * sin * dx));
        draw_stroke(picture, tip, barb, thickness, colour);
    }
}

/// Arrows for every `spacing`-th column and row of the planes `u`, `v` (row-major, `width x height`), half a
/// spacing in from the edge. The pixel of column `i`, row `j` is `(x0 + i step, y0 + j step)` with `origin =
/// (x0, y0)`: for planes on a coarse grid or of a region.
///
/// # Errors
/// [`Error::Argument`] for a spacing of 0 or a plane of another size.
pub fn arrows_on_grid<T: Real>(
    u: &[T],
    v: &[T],
    (width, height): (usize, usize),
    spacing: usize,
    origin: (f64, f64),
    step: f64,
) -> Result<Vec<Arrow>> {
    check_plane("u", u, width, height)?;
    check_plane("v", v, width, height)?;
    if spacing == 0 {
        return Err(Error::argument("spacing", "a positive integer", 0));
    }
    let mut arrows = Vec::new();
    for row in (spacing / 2..height).step_by(spacing) {
        for col in (spacing / 2..width).step_by(spacing) {
            let at = row * width + col;
            let (x, y) = (origin.0 + col as f64 * step, origin.1 + row as f64 * step);
            arrows.push(Arrow { x, y, u: u[at].to_f64(), v: v[at].to_f64() });
        }
    }
    Ok(arrows)
}
