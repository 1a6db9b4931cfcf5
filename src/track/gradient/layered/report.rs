//! What the tracker reports of the target.

use super::{finding::Finding, state::State};
use crate::types::{TargetBox, TrackState, TrackStatus};

/// Frames without a measurement after which the target is lost.
const MAX_MISSED_FRAMES: usize = 15;

pub(super) fn report(tracker: &State, state: &mut TrackState, found: Option<&Finding>, motion: [f64; 2]) {
    let (status, reason) = match found {
        Some(found) if found.occluded => (TrackStatus::Occluded, found.reason),
        Some(found) => (TrackStatus::Tracking, found.reason),
        None if tracker.history.missed >= MAX_MISSED_FRAMES => (TrackStatus::Lost, "not seen for long"),
        None => (TrackStatus::Coasting, "the target is not seen"),
    };
    (state.status, state.reason) = (status, reason.into());
    state.camera_motion = motion;
    let measured = sum(tracker.position(&tracker.motion.pose), tracker.undetermined());
    let before = state.bounds.centre();
    state.displacement = if found.is_some() { [0, 1].map(|k| measured[k] - before[k]) } else { [f64::NAN; 2] };
    report_motion(tracker, state);
    (state.scale, state.rotation) = (tracker.motion.pose.scale(), tracker.motion.rotation);
    state.rotation_observable = tracker.motion.rotation_observable;
    state.visibility = found.map_or(0.0, |found| found.score.visibility);
    state.innovation = found.map_or(f64::NAN, |found| found.nis);
}

pub(super) fn report_motion(tracker: &State, state: &mut TrackState) {
    let (speed, motion) = (tracker.motion.filter.speed(), state.camera_motion);
    // The filter's velocity is relative to the scene, or to the picture if the camera follows.
    (state.velocity, state.scene_velocity) = if tracker.motion.rides_camera {
        (speed, [0, 1].map(|k| speed[k] - motion[k]))
    } else {
        ([0, 1].map(|k| speed[k] + motion[k]), speed)
    };
    // The filter follows the support as learned.
    let undetermined = tracker.undetermined();
    state.position = sum(tracker.motion.filter.position(), undetermined);
    state.acceleration = tracker.motion.filter.acceleration();
    state.covariance = tracker.covariance();
    let bounds = tracker.bounds(&tracker.motion.pose);
    state.bounds = TargetBox { x: bounds.x + undetermined[0], y: bounds.y + undetermined[1], ..bounds };
}

fn sum(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] + b[0], a[1] + b[1]]
}

/// A target that has left the picture waits at its border.
pub(super) fn hold_at_border(tracker: &mut State, state: &mut TrackState, (width, height): (usize, usize)) {
    if tracker.history.missed == 0 || !crate::ablation::keeps("gradient.hold_at_border") {
        return;
    }
    let bounds = tracker.bounds(&tracker.motion.pose);
    let half = [0.5 * bounds.width, 0.5 * bounds.height];
    let lengths = [width as f64, height as f64];
    let position = tracker.motion.filter.position();
    // One that waits there is still out.
    let outside = (0..2).any(|k| position[k] <= -half[k] || position[k] >= lengths[k] - 1.0 + half[k]);
    if !outside {
        return;
    }
    for k in 0..2 {
        tracker.motion.filter.x[k][0] = position[k].clamp(-half[k], lengths[k] - 1.0 + half[k]);
        (tracker.motion.filter.x[k][1], tracker.motion.filter.x[k][2]) = (0.0, 0.0);
    }
    tracker.motion.pose = tracker.placed(tracker.motion.pose, tracker.motion.filter.position());
    report_motion(tracker, state);
    let (status, reason) = if tracker.history.missed >= MAX_MISSED_FRAMES {
        (TrackStatus::Lost, "out of the picture for long")
    } else {
        (TrackStatus::Out, "out of the picture")
    };
    (state.status, state.reason) = (status, reason.into());
}
