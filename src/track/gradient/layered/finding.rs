//! What a frame shows of the target: alignment at a guess, then its score.

use super::alignment::{Alignment, align};
use super::pose::Pose;
use super::score::{Score, score, view};
use super::state::State;
use super::task::{MotionModel, Task, VoteMask};
use crate::types::Frame;

/// Standard deviations of the increment from the prediction: of the position, px, and of size and angle.
pub(super) const PRIOR: [f64; 2] = [3.0, 0.02];
/// Levels of a frame like the one before, and of one after an interruption; px.
pub(super) const LEVELS: [f64; 4] = [4.0, 2.0, 1.0, 0.5];
/// Least visibility of a target that is seen well.
pub(super) const MIN_VISIBILITY_TO_LEARN: f64 = 0.75;
/// Least visibility that is measured; and after a miss.
pub(super) const MIN_VISIBILITY: [f64; 2] = [0.35, 0.5];
/// Least difference of the target from what is behind it, over the noise.
pub(super) const MIN_CONTRAST_PER_NOISE: f64 = 1.0;
/// Innovation squared from which on a measurement is doubted.
pub(super) const DOUBTED_INNOVATION: f64 = 12.0;
/// Frames in which the support is still adapting to what the box holds.
pub(super) const SETTLING_FRAMES: usize = 6;
pub(super) const COVERED: &str = "something covers the target";
/// Part of the target's area that may look like it beside it.
pub(super) const MAX_ADJACENT_SHARE: f64 = 0.06;
pub(super) const TOUCHED: &str = "something like the target touches it";
pub(super) const SEARCHED: &str = "found by looking all around";
/// Loss of visibility that is one.
pub(super) const MIN_VISIBILITY_LOSS: f64 = 0.08;
/// Innovation squared up to which a measurement is not questioned when the camera moves.
pub(super) const MAX_UNDOUBTED_INNOVATION: f64 = 4.0;
pub(super) const RESIZED: &str = "what seemed to cover the target was a change of its size";

#[derive(Debug, Clone, Copy)]
pub(super) struct Finding {
    pub aligned: Alignment,
    pub score: Score,
    /// Normalised innovation squared.
    pub nis: f64,
    pub occluded: bool,
    pub reason: &'static str,
}

pub(super) fn try_at(
    state: &State,
    frame: &Frame<f64>,
    guess: &Pose,
    how: (MotionModel, VoteMask, [f64; 2], &[f64]),
) -> Option<Finding> {
    let (motion_model, vote_mask, prior, levels) = how;
    let task = Task {
        frame,
        target: &state.target,
        background: &state.background,
        noise: state.scene.noise,
        motion_model,
        vote_mask,
        prior,
        levels,
    };
    let aligned = align(task, guess, 1.0)?;
    let view = view(frame, &state.target, &state.background, &aligned.pose);
    let score = score(&state.target, &view, aligned.gain, state.scene.noise);
    Some(Finding { nis: state.nis(&aligned.pose), aligned, score, occluded: false, reason: "" })
}
