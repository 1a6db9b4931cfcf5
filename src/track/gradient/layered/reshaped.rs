//! A target whose outline changes as no similarity does: it breathes, bends or turns out of the plane.
//!
//! A similarity that follows it shrinks, or stays at one edge, and what looks like the target lies beyond its
//! outline. Where an affine map from the expected pose explains nearly all of it, that is the pose, from
//! which similarities are tried again.

use super::finding::{
    DOUBTED_INNOVATION, Finding, MAX_ADJACENT_SHARE, MAX_UNDOUBTED_INNOVATION, MIN_VISIBILITY_LOSS,
    MIN_VISIBILITY_TO_LEARN, PRIOR, try_at,
};
use super::state::State;
use super::task::{MotionModel, VoteMask};
use crate::types::Frame;

/// Share of the target's area where support and picture disagree, from which on the outline is doubted.
const MIN_MISMATCH: f64 = 0.2;
/// Part of the target's area beside it that looks like it, from which on it is taken for the target's own.
const MIN_ADJACENT_SHARE: f64 = 0.03;
/// One-sidedness from which on that may be another object: the map must be at the expected place.
const MIN_ONE_SIDED: f64 = 0.5;
/// What an affine map may leave of the area that is not explained, share.
const MAX_MISMATCH_RATIO: f64 = 0.8;
/// Least size over that of the frame before: what shrinks faster is covered.
const MIN_SCALE_RATIO: f64 = 0.95;

/// The target under an affine map, where that explains an outline that a similarity, `plain`, does not.
pub(super) fn locate_reshaped(state: &State, frame: &Frame<f64>, plain: &Finding, levels: &[f64]) -> Option<Finding> {
    let [width, height] = state.target.extent();
    let doubted = plain.score.mismatch > MIN_MISMATCH * width * height && plain.score.leak > MIN_ADJACENT_SHARE;
    // Of what comes out again, the rest is hidden still.
    let returns = state.history.missed > 0 || state.history.reappearing > 0;
    if state.motion_model != MotionModel::Similarity || returns || !doubted {
        return None;
    }
    let guess = state.expected();
    let mut found = try_at(state, frame, &guess, (MotionModel::Affine, VoteMask::None, PRIOR, levels))?;
    // Which way a stretched outline is turned is determined by the similarity, if at all.
    found.aligned.rotation_observable = plain.aligned.rotation_observable;
    let farthest = if plain.score.one_sided < MIN_ONE_SIDED { DOUBTED_INNOVATION } else { MAX_UNDOUBTED_INNOVATION };
    let expected = found.nis < farthest && found.aligned.pose.scale() > MIN_SCALE_RATIO * state.motion.pose.scale();
    let seen = found.score.visibility >= MIN_VISIBILITY_TO_LEARN
        && found.score.visibility > plain.score.visibility - MIN_VISIBILITY_LOSS;
    let explained =
        found.score.leak < MAX_ADJACENT_SHARE && found.score.mismatch < MAX_MISMATCH_RATIO * plain.score.mismatch;
    (expected && seen && explained).then_some(found)
}
