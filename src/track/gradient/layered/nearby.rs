//! The motion of what is around the target, where the scene does not move as one.
//!
//! Two planes pass a camera at two speeds. What most of the picture does, or the mean of both, says nothing
//! of the background that the target is before, whose texture would be taken for the target's.

use super::layers::{grown, holds};
use super::samples::{MAX_RESIDUAL_RATIO, SAME_MOTION, SCENE_MARGIN, Samples};
use crate::types::{Frame, TargetBox};

/// Farthest from the target, px.
const MAX_DISTANCE: f64 = 48.0;
/// Pixels that it is measured on, about.
const SAMPLES: usize = 1024;
/// Fewest of them.
const MIN_SAMPLES: usize = 256;
/// Mean residual up to which the motion of the scene explains them: so many times the noise, and grey levels.
const EXPLAINED: (f64, f64) = (3.0, 1.0);
/// Farthest another motion may be from it along both axes, px.
const REACH: i32 = 3;

/// Motion around the target, px: `scene` unless another explains it clearly better; `before`: previous one.
pub(super) fn nearby(
    (previous, now): (&Frame<f64>, &Frame<f64>),
    target: TargetBox,
    (scene, before): ([f64; 2], [f64; 2]),
    noise: f64,
) -> [f64; 2] {
    let samples = Samples::at(previous, around(target, previous.size()));
    if samples.len() < MIN_SAMPLES {
        return scene;
    }
    let left = samples.capped(now, scene);
    if left < EXPLAINED.0 * noise + EXPLAINED.1 {
        return scene;
    }
    // Where two motions meet, steps from the mean of both end there.
    let whole = (-REACH..=REACH).flat_map(|dy| (-REACH..=REACH).map(move |dx| [dx, dy]));
    let tried = whole.map(|d| [0, 1].map(|k| scene[k].round() + f64::from(d[k]))).chain([before]);
    let best = tried.map(|motion| (samples.capped(now, motion), motion)).min_by(|a, b| a.0.total_cmp(&b.0));
    let other = best.and_then(|(_, motion)| samples.refine(now, motion, noise)).filter(|other| {
        let apart = (other[0] - scene[0]).hypot(other[1] - scene[1]);
        apart >= SAME_MOTION && samples.capped(now, *other) < MAX_RESIDUAL_RATIO * left
    });
    other.unwrap_or(scene)
}

/// Pixels around the target, spread evenly, two from the border at least.
fn around(target: TargetBox, (width, height): (usize, usize)) -> Vec<(usize, usize)> {
    let (hidden, reach) = (grown(target, (0.0, SCENE_MARGIN)), grown(target, (0.0, MAX_DISTANCE)));
    let step = ((reach.width * reach.height - hidden.width * hidden.height) / SAMPLES as f64).sqrt().ceil().max(1.0);
    let along = |from: f64, length: f64, size: usize| {
        let inside = |at: f64| (at.max(2.0) as usize).min(size.saturating_sub(2));
        (inside(from)..inside(from + length)).step_by(step as usize)
    };
    let rows = along(reach.y, reach.height, height);
    let pixels = rows.flat_map(|y| along(reach.x, reach.width, width).map(move |x| (x, y)));
    pixels.filter(|(x, y)| !holds(&hidden, *x, *y)).collect()
}
