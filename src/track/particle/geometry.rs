//! Boxes by their centre: what lies in them, and how they meet each other and the picture.

use crate::types::TargetBox;

/// Targets are near each other, too, if their boxes shrunk to this overlap.
const NEAR_BOXES: f64 = 0.9;

/// A box by its centre: x, y, width, height, px.
pub(super) type CentredBox = [f64; 4];

/// Whether a place lies in a box whose sides are multiplied by `factor` and moved out by `margin` px.
pub(super) fn holds([x, y, w, h]: CentredBox, [px, py]: [f64; 2], factor: f64, margin: f64) -> bool {
    (px - x).abs() < 0.5 * factor * w + margin && (py - y).abs() < 0.5 * factor * h + margin
}

/// Share of a box that another one covers.
pub(super) fn covered_share(own: CentredBox, other: CentredBox) -> f64 {
    let side = |i: usize| {
        let (low, high) = (
            (own[i] - own[i + 2] / 2.0).max(other[i] - other[i + 2] / 2.0),
            (own[i] + own[i + 2] / 2.0).min(other[i] + other[i + 2] / 2.0),
        );
        (high - low).max(0.0)
    };
    side(0) * side(1) / (own[2] * own[3])
}

/// Share of a box that lies in a picture of this size.
pub(super) fn visible_share([x, y, w, h]: CentredBox, (width, height): (usize, usize)) -> f64 {
    let side = |centre: f64, length: f64, size: usize| {
        let (low, high) = (centre - length / 2.0, centre + length / 2.0);
        (high.min(size as f64 - 0.5) - low.max(-0.5)).max(0.0) / length
    };
    side(x, w, width) * side(y, h, height)
}

/// Whether two predicted boxes overlap once they are shrunk.
pub(super) fn boxes_touch(a: CentredBox, b: CentredBox) -> bool {
    (0..2).all(|i| (a[i] - b[i]).abs() < 0.5 * NEAR_BOXES * (a[2 + i] + b[2 + i]))
}

pub(super) fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

pub(super) fn centred(bounds: TargetBox) -> CentredBox {
    let [x, y] = bounds.centre();
    [x, y, bounds.width, bounds.height]
}
