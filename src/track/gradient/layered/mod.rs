//! The layered tracker: the target and what is behind it as two layers, and one gradient step over the whole
//! target from the filter's prediction.
//!
//! `state` holds all that is known of the target; its parts are `pose`, `patch`, `layers` and `initial`.
//! `oriented_box` is what the target may hide.
//! A frame passes these stages:
//!
//! 1. `scene`: is the frame usable, in which `light`, and how did the `camera` move (`samples`, `nearby`)?
//!    The background is shifted with it (`background_shift`).
//! 2. `restart`: in the first frames, the initial segmentation: does the box hold an `occluder`, or another
//!    box than that of what moves (`refit`)?
//! 3. `locate`: the target, by alignment (`task`, `level`, `alignment`) and a `score` (`finding`), with
//!    `occlusion`, a `search` all around, a changed outline (`reshaped`) or size (`resized`).
//! 4. `apply`: the measurement goes to the filter, and the layers `learn` from the frame. A target that
//!    vanishes goes on from its `last_good` state.
//! 5. `report`: status, box and covariance.

mod alignment;
mod apply;
mod background_shift;
mod camera;
mod finding;
mod initial;
mod last_good;
mod layers;
mod learn;
mod level;
mod light;
mod locate;
mod nearby;
mod occluder;
mod occlusion;
mod oriented_box;
mod patch;
mod pose;
mod refit;
mod report;
mod reshaped;
mod resized;
mod restart;
mod samples;
mod scene;
mod score;
mod search;
mod state;
mod task;

pub(super) use state::State;

use super::shift::shifted;
use crate::image::fill_holes;
use crate::types::{Frame, TargetBox, TrackState, TrackStatus};
use apply::{apply_measurement, coast};
use camera::FramePyramid;
use initial::InitialSegmentation;
use last_good::restore_last_good;
use locate::locate_with_camera;
use report::{hold_at_border, report};
use restart::{resolve_initial, update_displacement_uncertainty};
use scene::{follow_camera, is_blank, is_wild, measure_camera_motion, normalize_light};
use state::MIN_NOISE;
use std::borrow::Cow;

/// What is said of a frame with NaN, infinity or numbers that are no brightness.
const UNUSABLE: &str = "the frame cannot be used";
const BLANK: &str = "the frame shows nothing of the scene";
const WILD: &str = "the frame is nothing like those before";

/// A frame shifted to where the scene is in the next one, if the camera moved; NaN where nothing is known.
pub(super) fn stilled(frame: &Frame<f64>, next: &Frame<f64>) -> Option<Frame<f64>> {
    let nowhere = TargetBox::about([-1e6; 2], 0.0, 0.0);
    let seen = [frame, next].map(|frame| FramePyramid::new(frame.clone()));
    let motion = camera::camera_motion(&seen[0], &seen[1], nowhere, MIN_NOISE, [0.0; 2]);
    (motion != [0.0; 2]).then(|| shifted(frame, motion.map(|m| -m)))
}

/// The next frame, NaN where samples are missing; `None`: it cannot be used.
pub(super) fn update(tracker: &mut State, frame: Option<Cow<'_, Frame<f64>>>, state: &mut TrackState) {
    let was_lost = matches!(state.status, TrackStatus::Lost | TrackStatus::Out);
    tracker.scene.gap += 1;
    let Some(frame) = frame else { return pass_over(tracker, state, UNUSABLE) };
    let frame = &with_background(frame, &tracker.background.picture);
    if crate::ablation::keeps("gradient.blank_frame") && is_blank(tracker, frame) {
        return pass_over(tracker, state, BLANK);
    }
    let bounds = tracker.reached(&tracker.motion.pose);
    let light = light::light(frame, &tracker.background, bounds);
    let seen = FramePyramid::new(normalize_light(tracker, frame, light));
    let motion = measure_camera_motion(tracker, &seen, bounds);
    if crate::ablation::keeps("gradient.wild_frame") && is_wild(tracker, &seen.frame, bounds, motion) {
        tracker.scene.buffer = seen.frame.into_data();
        return pass_over(tracker, state, WILD);
    }
    tracker.scene.camera_velocity = motion.map(|m| m / tracker.scene.gap as f64);
    tracker.scene.gap = 0;
    follow_camera(tracker, motion, &seen.frame);
    tracker.motion.filter.predict();
    resolve_initial(tracker, &seen.frame, motion);
    if motion != [0.0; 2] {
        tracker.last_good = None;
    }
    let finding = locate_with_camera(tracker, &seen.frame, motion);
    if let Some(found) = &finding {
        apply_measurement(tracker, found, &seen.frame);
    } else {
        if crate::ablation::keeps("gradient.recall") {
            restore_last_good(tracker);
        }
        coast(tracker);
    }
    update_displacement_uncertainty(tracker);
    report(tracker, state, finding.as_ref(), motion);
    state.gain = tracker.gain * light.gain;
    state.reacquired = was_lost && finding.is_some();
    hold_at_border(tracker, state, frame.size());
    tracker.scene.buffer = std::mem::replace(&mut tracker.scene.previous, seen).frame.into_data();
}

/// What is missing shows what is behind the target: there it is hidden.
fn with_background<'a>(frame: Cow<'a, Frame<f64>>, background: &Frame<f64>) -> Cow<'a, Frame<f64>> {
    let Cow::Owned(mut frame) = frame else { return frame };
    for (value, behind) in frame.data_mut().iter_mut().zip(background.data()) {
        *value = if value.is_nan() { *behind } else { *value };
    }
    match fill_holes(&frame, None) {
        Cow::Owned(filled) => Cow::Owned(filled),
        Cow::Borrowed(_) => Cow::Owned(frame),
    }
}

fn pass_over(tracker: &mut State, state: &mut TrackState, reason: &'static str) {
    tracker.initial.iter_mut().for_each(InitialSegmentation::advance);
    tracker.motion.filter.predict();
    coast(tracker);
    report(tracker, state, None, [0.0; 2]);
    (state.reason, state.reacquired) = (reason.into(), false);
    let size = tracker.scene.previous.frame.size();
    hold_at_border(tracker, state, size);
}
