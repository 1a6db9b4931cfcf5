//! Recovery of a hidden target from tracks that move together and have no owner.

use super::corners::Track;
use super::geometry::{covered_share, distance, holds};
use super::labels::median_residual;
use super::prediction::{FrameContext, Prediction};
use super::target::Target;

/// Frames that a target must have been hidden for.
const HIDDEN_FRAMES: usize = 4;
/// Probability of not being background of a track that can be taken over.
const MIN_FOREGROUND: f64 = 0.7;
/// Growth of the reach across in each hidden frame, px at 480 rows.
const REACH_GROWTH: f64 = 2.0;
/// Largest reach across over the width, and reach up and down over the height; half a box is added.
const REACH: [f64; 2] = [2.5, 0.4];
/// Greatest difference of motion in a group, px/frame at 480 rows.
const TOGETHER: f64 = 2.4;
/// Smallest group, and its share of the usual number of tracks.
const MIN_GROUP: (f64, f64) = (6.0, 0.3);
/// Number of centres tried to each side of a group, and distance of the outermost over width and height.
const TRIALS: (i32, [f64; 2]) = (2, [0.4, 0.2]);
/// Share of the usual similarity that the best centre must have.
const MIN_SIMILARITY: f64 = 0.75;
/// Distance within which a group may belong to another target, over width and height.
const OTHER_REACH: [f64; 2] = [1.0, 0.6];

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Recovery {
    pub place: [f64; 2],
    /// Velocity relative to the background, px/frame.
    pub velocity: [f64; 2],
}

/// Looks for the target in the densest group of tracks without an owner.
pub(super) fn recover(target: &Target, own: usize, context: &FrameContext<'_>) -> Option<Recovery> {
    let prediction = &context.predictions[own];
    let on = context.factors.tracks && context.factors.colour && context.options.uses("particle.recovery");
    if prediction.hidden < HIDDEN_FRAMES || !on {
        return None;
    }
    // Two hidden targets in one place cannot be distinguished.
    let twin = |other: &Prediction| {
        other.id != prediction.id
            && !other.is_out
            && other.hidden > 0
            && covered_share(prediction.bounds, other.bounds) > 0.0
    };
    if crate::ablation::keeps("particle.recovery_twin") && context.predictions.iter().any(twin) {
        return None;
    }
    let group = densest_group(&free_tracks(own, context), prediction.bounds, context.scale);
    if (group.len() as f64) < MIN_GROUP.0.max(MIN_GROUP.1 * target.presence.tracks) {
        return None;
    }
    let velocity = median_residual(&group)?;
    let middle = [0, 1].map(|i| group.iter().map(|track| track.position[i]).sum::<f64>() / group.len() as f64);
    if crate::ablation::keeps("particle.recovery_other") && belongs_to_other(middle, velocity, own, context) {
        return None;
    }
    let [_, _, w, h] = prediction.bounds;
    let (steps, range) = TRIALS;
    let mut best: Option<(f64, [f64; 2])> = None;
    for j in -steps..=steps {
        for i in -steps..=steps {
            let offset = |k: i32, share: f64, side: f64| f64::from(k) / f64::from(steps) * share * side;
            let place = [middle[0] + offset(i, range[0], w), middle[1] + offset(j, range[1], h)];
            let similarity = target.appearance.similarity(context.bins, [place[0], place[1], w, h]);
            if best.is_none_or(|(most, _)| similarity > most) {
                best = Some((similarity, place));
            }
        }
    }
    let (similarity, place) = best?;
    let usual = target.presence.similarity?;
    (similarity >= MIN_SIMILARITY * usual).then_some(Recovery { place, velocity })
}

/// Tracks without an owner within reach of a hidden target, outside the boxes of those that are seen.
fn free_tracks<'a>(own: usize, context: &'a FrameContext<'_>) -> Vec<&'a Track> {
    let prediction = &context.predictions[own];
    let [x, y, w, h] = prediction.bounds;
    let grown = w + REACH_GROWTH * context.scale * prediction.hidden as f64;
    let reach = [grown.min(REACH[0] * w) + 0.5 * w, (REACH[1] + 0.5) * h];
    let is_free = |track: &&Track| {
        track.owner.is_none()
            && track.residual.is_some()
            && track.foreground > MIN_FOREGROUND
            && (track.position[0] - x).abs() <= reach[0]
            && (track.position[1] - y).abs() <= reach[1]
            && !context.predictions.iter().any(|other| {
                other.id != prediction.id
                    && !other.is_out
                    && other.hidden == 0
                    && holds(other.bounds, track.position, 1.0, 0.0)
            })
    };
    context.tracks.iter().filter(is_free).collect()
}

/// The most tracks that lie within half a box of one of them and move with it.
fn densest_group<'a>(tracks: &[&'a Track], [_, _, w, h]: [f64; 4], scale: f64) -> Vec<&'a Track> {
    let together = |a: &Track, b: &Track| {
        let (Some(p), Some(q)) = (a.residual, b.residual) else { return false };
        holds([a.position[0], a.position[1], w, h], b.position, 1.0, 0.0) && distance(p, q) < TOGETHER * scale
    };
    let group = |middle: &&Track| tracks.iter().copied().filter(|track| together(middle, track)).collect::<Vec<_>>();
    tracks.iter().map(group).fold(Vec::new(), |best, group| if group.len() > best.len() { group } else { best })
}

/// Whether a group lies near another target whose usual velocity it fits better.
fn belongs_to_other(middle: [f64; 2], velocity: [f64; 2], own: usize, context: &FrameContext<'_>) -> bool {
    let prediction = &context.predictions[own];
    context.predictions.iter().filter(|other| other.id != prediction.id && !other.is_out).any(|other| {
        let more = REACH_GROWTH * context.scale * other.hidden as f64;
        let near = (0..2).all(|i| (middle[i] - other.place[i]).abs() < OTHER_REACH[i] * other.bounds[2 + i] + more);
        near && distance(velocity, other.usual_velocity) < distance(velocity, prediction.usual_velocity)
    })
}
