//! Corner tracks as evidence for and against a target.

use super::corners::Track;
use super::geometry::holds;
use super::likelihood::{TrackEvidence, clutter_density, motion_density};
use super::noise::Noise;
use super::prediction::{FrameContext, Prediction};
use super::target::Target;

/// Half sides of the box whose tracks can count, over its sides.
const REACH_BOX: f64 = 0.65;
/// Standard deviations of the cloud, and of the position noise, by which that box is enlarged to each side.
const REACH_SPREAD: (f64, f64) = (6.0, 3.0);
/// Weight of background tracks as evidence against a moving target.
const BACKGROUND_PENALTY: f64 = 0.7;
/// Target speed from which the penalty is full, px/frame at 480 rows; below, it grows with the speed.
const FULL_PENALTY_SPEED: f64 = 1.0;
/// Weight of tracks inside another target's box.
const SHARED: f64 = 0.3;
/// Other targets' boxes are grown by this to each side, px at 480 rows.
const OTHER_MARGIN: f64 = 2.0;

pub(super) struct Evidence<'a> {
    pub own: usize,
    pub target: &'a Target,
    /// Predicted centre, px.
    pub place: [f64; 2],
    pub context: &'a FrameContext<'a>,
}

/// The tracks that can count for a target, each with its probability and its penalty.
pub(super) fn track_evidence(evidence: &Evidence<'_>) -> Vec<TrackEvidence> {
    let Evidence { own, target, place, context } = *evidence;
    let covariance = target.cloud.covariance(&target.cloud.mean());
    let noise = Noise::of_options(context.options, context.scale).position;
    let reach = [0, 1].map(|i| {
        let spread = REACH_SPREAD.0 * covariance[i][i].sqrt() + REACH_SPREAD.1 * noise;
        REACH_BOX * target.estimate[4 + i] + spread
    });
    let is_near = |track: &&Track| (0..2).all(|i| (track.position[i] - place[i]).abs() <= reach[i]);
    context.tracks.iter().filter(is_near).filter_map(|track| weigh_track(track, own, target, context)).collect()
}

/// Evidence of one track for a target; `None` if it has another owner.
fn weigh_track(track: &Track, own: usize, target: &Target, context: &FrameContext<'_>) -> Option<TrackEvidence> {
    let residual = track.residual?;
    let weighed =
        |probability, penalty| Some(TrackEvidence { position: track.position, residual, probability, penalty });
    match track.owner {
        Some(owner) if owner == target.id => return weighed(1.0, 0.0),
        Some(_) => return None,
        None => {}
    }
    let scale = context.scale;
    let velocity = target.velocity();
    let in_other = |other: &&Prediction| {
        other.id != context.predictions[own].id
            && !other.is_out
            && holds(other.bounds, track.position, 1.0, OTHER_MARGIN * scale)
    };
    let clutter = clutter_density(scale);
    let (mut shared, mut others) = (false, 0.0);
    for other in context.predictions.iter().filter(in_other) {
        shared = true;
        others += motion_density(residual, other.velocity, scale) + clutter;
    }
    if shared && crate::ablation::keeps("particle.shared_tracks") {
        let mine = motion_density(residual, velocity, scale);
        return weighed(SHARED * track.foreground * mine / (mine + others + clutter), 0.0);
    }
    let speed = velocity[0].hypot(velocity[1]) / (FULL_PENALTY_SPEED * scale);
    weighed(
        track.foreground,
        if crate::ablation::keeps("particle.background_penalty") { 1.0 } else { 0.0 }
            * BACKGROUND_PENALTY
            * (1.0 - track.foreground)
            * speed.min(1.0),
    )
}
