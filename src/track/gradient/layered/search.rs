//! Looking for the target all around, in whole pixels.

use super::{layers::Background, layers::CORE, layers::Target, layers::is_inside, pose::Pose};
use crate::image::cubic_at;
use crate::types::Frame;

/// Difference beyond which brightness is simply different, grey levels.
const MAX_DIFFERENCE: f64 = 30.0;
/// Weight of the difference from the background.
const LIKE_BEHIND: f64 = 0.5;
/// Least share of the target's points that must be in the picture.
const MIN_SHARE_IN_PICTURE: f64 = 0.4;
/// Most points that are compared at each place.
const MAX_POINTS: usize = 400;

/// Pose within `reach` px with the least `mean(min(|E - g T|, 30)) - 0.5 mean(min(|E - Bg|, 30))`. Places are
/// given up as soon as they cannot be the best.
pub(super) fn search(
    frame: &Frame<f64>,
    target: &Target,
    background: &Background,
    (guess, gain): (&Pose, f64),
    reach: usize,
) -> Option<Pose> {
    let core: Vec<_> = (0..target.a.height())
        .flat_map(|j| (0..target.a.width()).map(move |i| (i, j)))
        .filter(|(i, j)| target.a.get(*i, *j) > CORE)
        .collect();
    let every = core.len().div_ceil(MAX_POINTS).max(1);
    let points: Vec<_> =
        core.iter().step_by(every).map(|&(i, j)| (guess.turn(target.xi(i, j)), gain * target.t.get(i, j))).collect();
    let reach = reach as isize;
    let mut offsets: Vec<_> = (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| [dx, dy])).collect();
    // From the guess outwards: a good place that is found early spares most of the others.
    let far = |[dx, dy]: [isize; 2]| dx * dx + dy * dy;
    offsets.sort_by_key(|offset| far(*offset));
    let mut best: Option<(f64, Pose)> = None;
    for offset in offsets {
        let p = [0, 1].map(|k| (guess.p[k] + offset[k] as f64).round());
        let least = best.map_or(f64::INFINITY, |(least, _)| least);
        let Some(cost) = cost(frame, background, &points, (p, least)) else { continue };
        // Of equals the nearest to the guess wins, so that nothing depends on the order.
        let cost = cost + 1e-6 * far(offset) as f64;
        if cost < least {
            best = Some((cost, Pose { p, ..*guess }));
        }
    }
    best.map(|(_, pose)| pose)
}

/// Cost of a place; `None` if too little of it is in the picture, or if it cannot be less than `least`.
fn cost(
    frame: &Frame<f64>,
    background: &Background,
    points: &[([f64; 2], f64)],
    (p, least): ([f64; 2], f64),
) -> Option<f64> {
    let (mut own, mut behind, mut count, mut known) = (0.0, 0.0, 0, 0);
    let too_much = (least + LIKE_BEHIND * MAX_DIFFERENCE) * points.len() as f64;
    for (offset, bright) in points {
        let place = [p[0] + offset[0], p[1] + offset[1]];
        if !is_inside(place, frame) {
            continue;
        }
        // Points of an upright target of the first size lie on pixels.
        let seen = nearest(frame, place);
        own += (seen - bright).abs().min(MAX_DIFFERENCE);
        count += 1;
        if own > too_much {
            return None;
        }
        if background.is_known(place) {
            behind += (seen - nearest(&background.picture, place)).abs().min(MAX_DIFFERENCE);
            known += 1;
        }
    }
    if (count as f64) < MIN_SHARE_IN_PICTURE * points.len() as f64 || count == 0 {
        return None;
    }
    Some(own / count as f64 - LIKE_BEHIND * if known > 0 { behind / known as f64 } else { 0.0 })
}

#[inline(always)]
fn nearest(frame: &Frame<f64>, [x, y]: [f64; 2]) -> f64 {
    let (i, j) = ((x + 0.5) as usize, (y + 0.5) as usize);
    if i < frame.width() && j < frame.height() { frame.get(i, j) } else { cubic_at(frame, x, y) }
}
