//! Anti-aliased strokes.

use super::{Picture, Rgb};

/// Draws a straight stroke `thickness` px wide with round ends, covering pixels partly at its edge.
pub(super) fn draw_stroke(picture: &mut Picture, from: (f64, f64), to: (f64, f64), thickness: f64, colour: Rgb) {
    if ![from.0, from.1, to.0, to.1].iter().all(|c| c.is_finite()) {
        return;
    }
    let reach = thickness / 2.0 + 1.0;
    let columns = clipped(from.0.min(to.0) - reach, from.0.max(to.0) + reach, picture.width());
    for y in clipped(from.1.min(to.1) - reach, from.1.max(to.1) + reach, picture.height()) {
        for x in columns.clone() {
            let distance = distance_to_segment((x as f64, y as f64), from, to);
            let coverage = (thickness / 2.0 + 0.5 - distance).clamp(0.0, 1.0);
            if coverage > 0.0 {
                picture.blend(x as isize, y as isize, colour, coverage);
            }
        }
    }
}

/// The pixels from `low` to `high` that exist.
fn clipped(low: f64, high: f64, len: usize) -> std::ops::Range<usize> {
    let low = low.floor().max(0.0) as usize;
    low..(high.ceil().max(-1.0) + 1.0).min(len as f64) as usize
}

fn distance_to_segment(point: (f64, f64), from: (f64, f64), to: (f64, f64)) -> f64 {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let (px, py) = (point.0 - from.0, point.1 - from.1);
    let length2 = dx * dx + dy * dy;
    let along = if length2 > 0.0 { ((px * dx + py * dy) / length2).clamp(0.0, 1.0) } else { 0.0 };
    (px - along * dx).hypot(py - along * dy)
}
