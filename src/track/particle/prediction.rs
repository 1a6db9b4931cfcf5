//! Predictions before a frame is weighed: positions, near targets, hidden targets.

use super::camera::CameraMotion;
use super::corners::Track;
use super::foreground::ForegroundMap;
use super::geometry::{CentredBox, boxes_touch, covered_share, distance, holds};
use super::labels::review;
use super::noise::near_radius;
use super::options::{Likelihoods, ParticleMode, ParticleOptions};
use super::presence::COVER;
use super::target::{Target, labelled};
use crate::types::Frame;

/// Factor of the box in which tracks can end a target's being hidden.
const RETURN_BOX: f64 = 1.2;
/// Probability of not being background of such a track.
const RETURN_FOREGROUND: f64 = 0.7;
/// Greatest difference of its motion, px/frame at 480 rows.
const RETURN_DIFFERENCE: f64 = 2.4;

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Prediction {
    pub id: u64,
    /// Predicted centre, px.
    pub place: [f64; 2],
    /// Predicted box.
    pub bounds: CentredBox,
    /// Velocity relative to the background, px/frame, and the usual one.
    pub velocity: [f64; 2],
    pub usual_velocity: [f64; 2],
    /// Frames since it became hidden.
    pub hidden: usize,
    /// Whether it is out of the picture.
    pub is_out: bool,
    /// Which others are near.
    pub near: Vec<usize>,
    /// Greatest likeness of a near one's reference, 0 to 1.
    pub likeness: f64,
    /// Whether another predicted box covers half of its own.
    pub is_covered: bool,
    /// Whether it becomes hidden in this frame while its colours are unlike.
    pub entered_low: bool,
    /// Labelled tracks.
    pub labelled: usize,
}

/// Input that all targets share in one frame.
pub(super) struct FrameContext<'a> {
    pub options: &'a ParticleOptions,
    pub factors: Likelihoods,
    pub scale: f64,
    pub frame: usize,
    pub bins: &'a Frame<u8>,
    pub camera: CameraMotion,
    pub tracks: &'a [Track],
    pub foreground: Option<&'a ForegroundMap>,
    pub predictions: &'a [Prediction],
}

/// Predicts all targets. With the track factor, labels are reviewed and hidden targets recognised.
pub(super) fn predict_targets(
    targets: &mut [Target],
    tracks: &mut [Track],
    camera: &CameraMotion,
    (options, scale): (&ParticleOptions, f64),
) -> Vec<Prediction> {
    let mut predictions: Vec<Prediction> = targets.iter().map(|target| predicted(target, camera)).collect();
    find_near(&mut predictions, targets, options, scale);
    let judges_hidden = options.factors().tracks && options.uses("particle.hidden");
    if !judges_hidden {
        // A cut hides every target for one frame, in every mode.
        for target in targets.iter_mut() {
            target.presence.show();
        }
    }
    if !options.factors().tracks {
        return predictions;
    }
    review(tracks, &labelled(targets, |own, _| predictions[own].bounds), scale);
    for own in 0..targets.len() {
        let target = &mut targets[own];
        let count = tracks.iter().filter(|track| track.owner == Some(target.id)).count();
        predictions[own].labelled = count;
        if target.is_out || !judges_hidden {
            continue;
        }
        let returning = returning_tracks(tracks, &predictions, own, scale);
        let entered = target.presence.decide(count, predictions[own].is_covered, returning);
        predictions[own].entered_low = entered && target.presence.is_low;
        predictions[own].hidden = target.presence.hidden_frames();
    }
    predictions
}

fn predicted(target: &Target, camera: &CameraMotion) -> Prediction {
    let velocity = target.velocity();
    let place = camera.carry(target.place(), velocity);
    let growth = camera.growth();
    Prediction {
        id: target.id,
        place,
        bounds: [place[0], place[1], target.estimate[4] * growth, target.estimate[5] * growth],
        velocity,
        usual_velocity: target.presence.velocity,
        hidden: target.presence.hidden_frames(),
        is_out: target.is_out,
        near: Vec::new(),
        likeness: 0.0,
        is_covered: false,
        entered_low: false,
        labelled: 0,
    }
}

fn find_near(predictions: &mut [Prediction], targets: &[Target], options: &ParticleOptions, scale: f64) {
    let radius = near_radius(scale);
    for own in 0..predictions.len() {
        for other in 0..predictions.len() {
            let (a, b) = (&predictions[own], &predictions[other]);
            if own == other || a.is_out || b.is_out {
                continue;
            }
            let touch = crate::ablation::keeps("particle.touching_boxes")
                && options.mode == ParticleMode::Improved
                && boxes_touch(a.bounds, b.bounds);
            let covered = covered_share(a.bounds, b.bounds) >= COVER;
            if distance(a.place, b.place) <= radius || touch {
                let likeness = targets[own].appearance.likeness(&targets[other].appearance);
                let own = &mut predictions[own];
                own.near.push(other);
                own.likeness = own.likeness.max(likeness.min(1.0));
            }
            predictions[own].is_covered |= covered;
        }
    }
}

/// How many tracks at a target's place, outside the others' boxes, move as it does.
fn returning_tracks(tracks: &[Track], predictions: &[Prediction], own: usize, scale: f64) -> usize {
    let target = &predictions[own];
    let outside = |track: &&Track| {
        !predictions.iter().any(|l| l.id != target.id && !l.is_out && holds(l.bounds, track.position, 1.0, 0.0))
    };
    let moves_alike =
        |track: &&Track| track.residual.is_some_and(|r| distance(r, target.velocity) < RETURN_DIFFERENCE * scale);
    tracks
        .iter()
        .filter(|track| track.foreground > RETURN_FOREGROUND && holds(target.bounds, track.position, RETURN_BOX, 0.0))
        .filter(outside)
        .filter(moves_alike)
        .count()
}
