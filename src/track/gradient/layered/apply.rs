//! What a measurement changes of all that is known of the target, and what a frame without one does.

use super::finding::{
    COVERED, Finding, MIN_VISIBILITY, MIN_VISIBILITY_LOSS, MIN_VISIBILITY_TO_LEARN, RESIZED, SEARCHED, SETTLING_FRAMES,
    TOUCHED,
};
use super::last_good::{DAMPED, keep_last_good};
use super::learn;
use super::pose::Pose;
use super::score::view;
use super::state::{State, start_filter};
use crate::track::gradient::gauss_markov::Measurement;
use crate::types::Frame;

/// Innovation squared of a target found by looking all around from which on its velocity says nothing.
const JUMP_INNOVATION: f64 = 100.0;
/// Frames after a look-alike touched for which it is reckoned with.
const LOOK_ALIKE_FRAMES: usize = 8;
/// Minimum share of the possible information about the rotation for it to be reported; else the angle is
/// held. Round targets are known by their outline: this bounds what errors of that may turn.
const MIN_ROTATION_INFORMATION: f64 = 0.75;
/// Least standard deviation of a measured position, px.
const MIN_POSITION_STD: f64 = 0.05;
/// Frames after an interruption in which what is not seen of the target may be hidden still.
const REAPPEARING_FRAMES: usize = 3;
/// How far a target must have gone while it is young, over its shorter side, for what else its box holds
/// to have stayed behind; slower ones wait for that in vain.
const MIN_WAY_PER_SIDE: f64 = 0.4;
/// Rate of the mean visibility.
const VISIBILITY_RATE: f64 = 0.1;

/// How much farther the middle of the support may move than it did in a frame, and how much of that is
/// remembered in the next one: a box that is too large or beside the target takes a while to settle.
const SETTLING: (f64, f64) = (3.0, 0.8);
/// What it moves in a frame at rest, px.
const SETTLED: f64 = 0.02;

pub(super) fn apply_measurement(state: &mut State, found: &Finding, frame: &Frame<f64>) {
    let Finding { aligned, score, occluded, .. } = *found;
    let interrupted = state.history.missed > 0 || state.history.occluded || occluded;
    let mut pose = aligned.pose;
    if let Some(told) = aligned.rotation_observable {
        state.motion.rotation_observable =
            told >= MIN_ROTATION_INFORMATION || occluded && state.motion.rotation_observable;
    }
    let at = state.position(&pose);
    if crate::ablation::keeps("gradient.hold_angle") && !state.motion.rotation_observable && !occluded {
        pose = state.placed(pose.turned_to(state.motion.pose.angle()), at);
    }
    if !occluded {
        state.uncertainty.noise_to_contrast = (state.scene.noise / score.contrast.max(1.0)).min(1.0);
    }
    state.history.reappearing =
        if state.history.missed > 0 { REAPPEARING_FRAMES } else { state.history.reappearing.saturating_sub(1) };
    // Where a part of it is still hidden, all of it may be that much farther on.
    let behind = if crate::ablation::keeps("gradient.returning_variance") && state.history.reappearing > 0 {
        state.side() * (1.0 - score.visibility)
    } else {
        0.0
    };
    let visible = score.visibility.max(0.1);
    let variance: [f64; 2] = std::array::from_fn(|k| {
        let own = aligned.covariance[k][k].max(MIN_POSITION_STD.powi(2)) / (visible * visible);
        own + behind * behind + if occluded { (1.5 * (1.0 - score.visibility)).powi(2) } else { 0.0 }
    });
    let step = state.motion.last_position.filter(|_| !interrupted).map(|before| [at[0] - before[0], at[1] - before[1]]);
    if (found.reason == SEARCHED || found.reason == RESIZED)
        && found.nis > JUMP_INNOVATION
        && crate::ablation::keeps("gradient.restart_filter")
    {
        // Nobody moves like that: it is begun again where it was found.
        state.motion.filter = start_filter(at);
    }
    if occluded && !state.history.occluded && crate::ablation::keeps("gradient.damped") {
        state.motion.filter.x.iter_mut().for_each(|x| x[2] *= DAMPED);
    }
    state.motion.filter.update(&Measurement {
        position: Some((at, variance)),
        velocity: step.map(|step| (step, variance.map(|v| 2.0 * v))),
    });
    let smaller = state.has_shrunk(&pose);
    turn_to(state, &pose);
    keep_last_good(state, found, smaller);
    state.motion.last_position = (!occluded).then_some(at);
    (state.history.missed, state.history.occluded) = (0, occluded);
    state.history.occluded_frames = if occluded { state.history.occluded_frames + 1 } else { 0 };
    state.history.look_alike_cooldown =
        if found.reason == TOUCHED { LOOK_ALIKE_FRAMES } else { state.history.look_alike_cooldown.saturating_sub(1) };
    state.history.age += 1;
    state.history.max_visibility =
        if occluded { state.history.max_visibility } else { state.history.max_visibility.max(score.visibility) };
    if crate::ablation::keeps("gradient.lasting_cover")
        && found.reason == COVERED
        && score.visibility > state.history.mean_visibility - MIN_VISIBILITY_LOSS
    {
        // What stays hidden, though it is little, is not covered but gone.
        state.history.mean_visibility += VISIBILITY_RATE * (score.visibility - state.history.mean_visibility);
    }
    let [right, down] = state.motion.filter.speed();
    let far = right.hypot(down) * SETTLING_FRAMES as f64 > MIN_WAY_PER_SIDE * state.side() * state.motion.pose.scale();
    if state.history.age >= SETTLING_FRAMES && (occluded || !far || score.visibility >= MIN_VISIBILITY_TO_LEARN) {
        state.history.adapts_until = 0;
    }
    let least = if state.history.age <= SETTLING_FRAMES || state.is_adapting() {
        MIN_VISIBILITY[0]
    } else {
        MIN_VISIBILITY_TO_LEARN
    };
    if !occluded && score.visibility >= least {
        learn_from(state, frame, aligned.gain, score.visibility);
    }
}

pub(super) fn turn_to(state: &mut State, pose: &Pose) {
    let turn = pose.angle() - state.motion.pose.angle();
    state.motion.rotation += turn.sin().atan2(turn.cos());
    state.motion.pose = *pose;
}

pub(super) fn learn_from(state: &mut State, frame: &Frame<f64>, gain: f64, visibility: f64) {
    let view = view(frame, &state.target, &state.background, &state.motion.pose);
    let before = state.position(&state.motion.pose);
    learn::learn_target(&mut state.target, &view, gain, state.scene.noise);
    settle_outline(state, before);
    state.gain *= gain;
    state.history.mean_visibility += VISIBILITY_RATE * (visibility - state.history.mean_visibility);
    let hidden = state.hides();
    learn::learn_background(&mut state.background, frame, &hidden, state.scene.noise);
}

pub(super) fn coast(state: &mut State) {
    state.history.missed += 1;
    state.history.occluded_frames = 0;
    state.motion.last_position = None;
    state.motion.pose = state.placed(state.motion.pose, state.motion.filter.position());
}

/// The middle of the support was at a place before it was learned.
pub(super) fn settle_outline(state: &mut State, before: [f64; 2]) {
    let after = state.position(&state.motion.pose);
    for (k, unsettled) in state.uncertainty.outline.iter_mut().enumerate() {
        let moved = ((after[k] - before[k]).abs() - SETTLED).max(0.0);
        *unsettled = if crate::ablation::keeps("gradient.unsettled") { 1.0 } else { 0.0 }
            * (SETTLING.1 * *unsettled).max(SETTLING.0 * moved);
    }
}
