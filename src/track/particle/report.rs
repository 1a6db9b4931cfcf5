//! Assembles the result of a frame from the tracker's state.

use super::camera::CameraMotion;
use super::corners::Track;
use super::geometry::CentredBox;
use super::prediction::Prediction;
use super::step::{CornerTrack, ParticleStep, ParticleTarget};
use super::target::Target;
use crate::types::{TargetBox, TrackState, TrackStatus};

// Reasons of a status.
const LEFT: &str = "the centre leaves the picture";
const LOST: &str = "hidden for more than 30 frames";
const NOTHING_SHOWN: &str = "the frame shows nothing";
const CUT: &str = "the scene was cut";
const HIDDEN_BY_TARGET: &str = "hidden by another target";
const HIDDEN: &str = "hidden: few of its tracks, colours unlike";
const COVERED: &str = "another target covers half of it";
const UNLIKE: &str = "colours unlike those it usually has";
const NO_WEIGHT: &str = "no particle had a weight: the estimate is the prediction";

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum StepCause {
    /// Targets were given.
    Begin,
    /// A frame showed nothing.
    Nothing,
    /// Targets were looked for in a frame of the same scene.
    Frame,
    /// Targets were looked for in a frame that cut the scene.
    Cut,
}

pub(super) struct Tracked<'a> {
    pub frame: usize,
    pub targets: &'a [Target],
    pub tracks: &'a [Track],
    /// The targets of the step before.
    pub before: &'a [ParticleTarget],
}

pub(super) fn report(
    tracked: &Tracked<'_>,
    camera: &CameraMotion,
    predictions: &[Prediction],
    cause: StepCause,
) -> ParticleStep {
    let count = tracked.targets.len();
    let mut near = vec![false; count * count];
    for (own, prediction) in predictions.iter().enumerate() {
        for &other in &prediction.near {
            near[own * count + other] = true;
        }
    }
    let target = |(own, target): (usize, &Target)| {
        let n_tracks = tracked.tracks.iter().filter(|track| track.owner == Some(target.id)).count();
        let (status, reason) = status_of(target, predictions.get(own), cause);
        let before = tracked.before.iter().find(|before| before.id == target.id);
        ParticleTarget {
            id: target.id,
            state: state_of(target, tracked.frame, camera, (status, reason), before),
            size: [target.estimate[4], target.estimate[5]],
            covariance: target.cloud.covariance(&target.cloud.mean()),
            effective_sample_size: target.effective_sample_size,
            similarity: target.similarity,
            n_tracks,
            degenerate: target.degenerate,
        }
    };
    let measured = matches!(cause, StepCause::Frame | StepCause::Cut);
    let tracks = if measured { tracked.tracks.iter().filter_map(corner).collect() } else { Vec::new() };
    ParticleStep {
        frame: tracked.frame,
        targets: tracked.targets.iter().enumerate().map(target).collect(),
        near,
        camera: camera.to_affine(),
        tracks,
    }
}

fn corner(track: &Track) -> Option<CornerTrack> {
    Some(CornerTrack {
        id: track.id,
        position: track.position,
        residual: track.residual?,
        foreground: track.foreground,
        owner: track.owner,
    })
}

/// Status and its reason.
fn status_of(target: &Target, prediction: Option<&Prediction>, cause: StepCause) -> (TrackStatus, &'static str) {
    let presence = &target.presence;
    let is_covered = prediction.is_some_and(|prediction| !prediction.near.is_empty() && prediction.is_covered);
    if target.is_out {
        (TrackStatus::Out, LEFT)
    } else if presence.is_lost() {
        (TrackStatus::Lost, LOST)
    } else if cause == StepCause::Nothing {
        (TrackStatus::Coasting, NOTHING_SHOWN)
    } else if cause == StepCause::Cut {
        (TrackStatus::Coasting, CUT)
    } else if presence.is_hidden() {
        (TrackStatus::Coasting, if is_covered { HIDDEN_BY_TARGET } else { HIDDEN })
    } else if is_covered {
        (TrackStatus::Occluded, COVERED)
    } else if presence.is_low {
        (TrackStatus::Occluded, UNLIKE)
    } else if target.degenerate {
        (TrackStatus::Tracking, NO_WEIGHT)
    } else {
        (TrackStatus::Tracking, "")
    }
}

/// The state that files and overlays are written from.
fn state_of(
    target: &Target,
    frame: usize,
    camera: &CameraMotion,
    (status, reason): (TrackStatus, &'static str),
    before: Option<&ParticleTarget>,
) -> TrackState {
    let [x, y, w, h]: CentredBox = target.bounds();
    let [u, v] = target.velocity();
    let moved = camera.at([x, y]);
    let covariance = target.cloud.covariance(&target.cloud.mean());
    let unknown = f64::NAN;
    let axis = |i: usize| {
        let (pp, pv, vv) = (covariance[i][i], covariance[i][i + 2], covariance[i + 2][i + 2]);
        [[pp, pv, unknown], [pv, vv, unknown], [unknown; 3]]
    };
    let was_gone = before.is_some_and(|before| matches!(before.state.status, TrackStatus::Lost | TrackStatus::Out));
    let usual = target.presence.similarity.unwrap_or(target.similarity);
    TrackState {
        frame,
        status,
        reason: reason.into(),
        reacquired: was_gone && status.is_measured(),
        velocity: [u + moved[0], v + moved[1]],
        acceleration: [unknown; 2],
        scene_velocity: [u, v],
        camera_motion: moved,
        covariance: [axis(0), axis(1)],
        displacement: before.map_or([unknown; 2], |b| [x - b.state.position[0], y - b.state.position[1]]),
        scale: (w * h / (target.first_size[0] * target.first_size[1])).sqrt(),
        rotation: unknown,
        rotation_observable: false,
        visibility: if usual > 0.0 { (target.similarity / usual).min(1.0) } else { 0.0 },
        gain: unknown,
        ..TrackState::at([x, y], TargetBox::about([x, y], w, h))
    }
}
