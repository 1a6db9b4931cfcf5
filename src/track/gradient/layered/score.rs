//! What is seen of the target at a pose, and what there is beside it that looks like it.

use super::{layers::Background, layers::CORE, layers::Target, layers::is_inside, pose::Pose};
use crate::types::Frame;

/// Contrast at which a point counts in full, grey levels.
const CONTRAST: f64 = 60.0;
/// Contrast of points whose background is not known, grey levels.
const UNKNOWN: f64 = 30.0;

#[derive(Debug, Clone)]
pub(super) struct View {
    /// Brightness; NaN outside the picture.
    pub seen: Vec<f64>,
    /// Background; NaN where it was never seen, or outside the picture.
    pub behind: Vec<f64>,
    /// The same with a guess where it was never seen.
    pub guess: Vec<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Score {
    /// Share of the target that is seen, weighed by its contrast.
    pub visibility: f64,
    /// Mean difference of the target from what is known or thought to be behind it, grey levels.
    pub contrast: f64,
    /// Points beside the target that look like it, over its area.
    pub leak: f64,
    /// How far those lie on one side, 0 to 1.
    pub one_sided: f64,
    /// Area in which the support is not the one that the picture alone determines, px of the target squared.
    pub mismatch: f64,
}

pub(super) fn view(frame: &Frame<f64>, target: &Target, background: &Background, pose: &Pose) -> View {
    let places = target.places(pose);
    let (mut seen, mut behind) = (Vec::new(), Vec::new());
    places.read(frame, [0.0; 2], &mut seen);
    places.read(&background.picture, [0.0; 2], &mut behind);
    let guess = behind.clone();
    for at in 0..seen.len() {
        let place = places.get(at);
        if !is_inside(place, frame) {
            (seen[at], behind[at]) = (f64::NAN, f64::NAN);
        } else if !background.is_known(place) {
            behind[at] = f64::NAN;
        }
    }
    View { seen, behind, guess }
}

/// Whether the target is what is seen at a point; `contrast` is that to the background, where that is known.
pub(super) fn is_hit(seen: f64, bright: f64, behind: f64, noise: f64) -> bool {
    let off = (seen - bright).abs();
    let contrast = if behind.is_nan() { UNKNOWN } else { (bright - behind).abs() };
    let nearer = behind.is_nan() || off < (seen - behind).abs();
    nearer && off < 4.0 * noise + 0.15 * contrast + 6.0
}

/// Difference of the support from that by brightness alone, the target's share of a mixture; it resolves
/// fractions of a pixel at edges. Points where the layers are too alike are left out.
fn mismatch(a: f64, seen: f64, bright: f64, behind: f64, noise: f64) -> f64 {
    let contrast = bright - behind;
    if contrast.abs() > 4.0 * noise && !seen.is_nan() {
        (((seen - behind) / contrast).clamp(0.0, 1.0) - a).abs()
    } else {
        0.0
    }
}

pub(super) fn score(target: &Target, view: &View, gain: f64, noise: f64) -> Score {
    let near = target.near();
    let (mut hit, mut all, mut area) = (0.0, 0.0, 0.0);
    let (mut difference, mut count) = (0.0, 0.0);
    let (mut alike, mut sum, mut lengths) = (0.0, [0.0; 2], 0.0);
    let mut apart = 0.0;
    for (at, (&a, &t)) in target.a.data().iter().zip(target.t.data()).enumerate() {
        let (seen, behind, bright) = (view.seen[at], view.behind[at], gain * t);
        area += a;
        if near.data()[at] {
            apart += mismatch(a, seen, bright, view.guess[at], noise);
        }
        if a > CORE {
            let contrast = if behind.is_nan() { UNKNOWN } else { (bright - behind).abs() };
            let counts = contrast.min(CONTRAST) * if contrast < 2.5 * noise { 0.1 } else { 1.0 };
            all += counts;
            difference += (bright - view.guess[at]).abs();
            count += 1.0;
            // Outside the picture nothing is seen.
            if is_hit(seen, bright, behind, noise) {
                hit += counts;
            }
        } else if a < 0.2
            && near.data()[at]
            && (bright - behind).abs() > 4.0 * noise
            && is_hit(seen, bright, behind, noise)
        {
            let xi = target.xi(at % target.a.width(), at / target.a.width());
            alike += 1.0;
            sum = [sum[0] + xi[0], sum[1] + xi[1]];
            lengths += xi[0].hypot(xi[1]);
        }
    }
    Score {
        contrast: if count > 0.0 { difference / count } else { 0.0 },
        visibility: if all > 0.0 { hit / all } else { 0.0 },
        leak: if area > 0.0 { alike / area } else { 0.0 },
        one_sided: if lengths > 0.0 { sum[0].hypot(sum[1]) / lengths } else { 0.0 },
        mismatch: apart,
    }
}
