//! Boxes by their centre, and what lies in them.

use super::appearance::CentredBox;
use crate::types::TargetBox;

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

pub(super) fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

pub(super) fn centred(bounds: TargetBox) -> CentredBox {
    let [x, y] = bounds.centre();
    [x, y, bounds.width, bounds.height]
}
