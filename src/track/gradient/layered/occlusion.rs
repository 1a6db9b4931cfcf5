//! Targets that a known surface covers in part, or begins to cover.

use super::finding::{
    COVERED, DOUBTED_INNOVATION, Finding, LEVELS, MAX_ADJACENT_SHARE, MIN_CONTRAST_PER_NOISE, MIN_VISIBILITY_LOSS,
    PRIOR, SETTLING_FRAMES, try_at,
};
use super::score::Score;
use super::state::State;
use super::task::{MotionModel, VoteMask};
use crate::types::Frame;

/// Visibility of a target of which nothing is hidden.
pub(super) const WHOLE: f64 = 0.95;
/// Loss of visibility that noise alone may make.
pub(super) const SLIGHT: f64 = 0.03;
/// Width of a strip along a side of the target that is begun to be covered, px: of smaller targets it is a
/// loss of visibility.
pub(super) const STRIP: f64 = 1.25;
/// Distance of two poses that a covered edge makes, px.
pub(super) const HELD_BACK: f64 = 0.5;

/// Least visibility of a target that is known to be hidden in part.
const MIN_EMERGING_VISIBILITY: f64 = 0.1;

/// Whether an object hides the part of the target that it hid in the first frame: that part was never seen.
pub(super) fn is_emerging(state: &State) -> bool {
    state.history.occluded && state.target.fresh.is_some() && crate::ablation::keeps("gradient.emerging")
}

/// A target that emerges: it is as large as the first box, and only its position is looked for.
pub(super) fn locate_emerging(state: &State, frame: &Frame<f64>) -> Option<Finding> {
    let how = (MotionModel::Translation, VoteMask::Occluded, PRIOR, &LEVELS[1..]);
    let found = try_at(state, frame, &state.expected(), how)?;
    let whole = found.score.visibility > 1.0 - if is_large(state) { SLIGHT } else { MIN_VISIBILITY_LOSS };
    let seen = found.score.visibility >= MIN_EMERGING_VISIBILITY
        && found.score.contrast >= MIN_CONTRAST_PER_NOISE * state.scene.noise;
    seen.then_some(Finding { occluded: !whole, reason: if whole { "" } else { COVERED }, ..found })
}

/// A known surface covers the target: only its position is looked for, where it is not covered.
pub(super) fn locate_occluded(
    state: &State,
    frame: &Frame<f64>,
    plain: Option<Finding>,
    levels: &[f64],
) -> Option<Finding> {
    let how = (MotionModel::Translation, VoteMask::Occluded, [position_std(state), PRIOR[1]], levels);
    let found = try_at(state, frame, &state.expected(), how)?;
    let dropped = |score: &Score, by: f64| score.visibility < state.history.mean_visibility - by;
    // What is seen as well as ever in a place that nobody expected has made a turn; unless it became
    // smaller at that, as what lies between the bars of a fence.
    let turned = |plain: &Finding| {
        plain.nis > DOUBTED_INNOVATION && !dropped(&plain.score, SLIGHT) && !state.has_shrunk(&plain.aligned.pose)
    };
    // Nor has one that is where it is expected but for a strip along its side, and would be smaller or
    // less seen elsewhere.
    let begins = plain
        .is_some_and(|plain| plain.nis > DOUBTED_INNOVATION && !turned(&plain) && is_held_back(state, &found, &plain));
    // The last strip of a large target is not to be taken for background.
    let drop = if begins || state.history.occluded && is_large(state) { SLIGHT } else { MIN_VISIBILITY_LOSS };
    let also =
        plain.is_none_or(|plain| !turned(&plain) && (dropped(&plain.score, drop) || plain.nis > DOUBTED_INNOVATION));
    let held_back = plain.is_some_and(|plain| may_be_held_back(state, &plain) && is_held_back(state, &found, &plain));
    let taken = found.score.leak < MAX_ADJACENT_SHARE && dropped(&found.score, drop) && (also || held_back);
    taken.then_some(Finding { occluded: true, reason: COVERED, ..found })
}

/// A large target whose edge begins to be covered: the side towards which it is off has no vote.
pub(super) fn locate_entering_occlusion(state: &State, frame: &Frame<f64>, plain: &Finding) -> Option<Finding> {
    let (at, expected) = (state.position(&plain.aligned.pose), state.motion.filter.position());
    let side = VoteMask::Towards([expected[0] - at[0], expected[1] - at[1]]);
    let how = (MotionModel::Translation, side, PRIOR, &LEVELS[1..]);
    let found = try_at(state, frame, &state.expected(), how)?;
    let taken = found.score.leak < MAX_ADJACENT_SHARE && is_held_back(state, &found, plain);
    taken.then_some(Finding { occluded: true, reason: COVERED, ..found })
}

/// Whether what is not seen may be covered: not while the support still adapts, except for a large target
/// seen whole. A wrong box leaves as much of a small target unseen as cover.
pub(super) fn is_settled(state: &State) -> bool {
    state.history.age >= SETTLING_FRAMES && !state.is_adapting()
        || crate::ablation::keeps("gradient.known_if_large") && state.history.max_visibility > WHOLE && is_large(state)
}

/// Whether a strip along a side is little of the target.
pub(super) fn is_large(state: &State) -> bool {
    STRIP / state.side() < MIN_VISIBILITY_LOSS
}

/// Whether a large target is off its expected place; the filter cannot judge fractions of a pixel.
pub(super) fn may_be_held_back(state: &State, plain: &Finding) -> bool {
    is_large(state) && distance_from_expected(state, plain) > HELD_BACK
}

/// Whether a large target is rather `elsewhere`, nearer to the prediction, than at `plain`. The edge of an
/// occluder holds an even target back or shrinks it; the unexplained area stays the same. A target that has
/// really turned leaves two unexplained strips, as long as the target and as wide as it is off.
pub(super) fn is_held_back(state: &State, elsewhere: &Finding, plain: &Finding) -> bool {
    let [at, held] = [elsewhere, plain].map(|finding| state.position(&finding.aligned.pose));
    let apart = (at[0] - held[0]).hypot(at[1] - held[1]);
    let strip = apart * state.side() / plain.aligned.pose.scale().max(0.1);
    crate::ablation::keeps("gradient.held_back")
        && apart > HELD_BACK
        && elsewhere.nis < DOUBTED_INNOVATION
        && elsewhere.score.mismatch < plain.score.mismatch + strip
}

pub(super) fn distance_from_expected(state: &State, found: &Finding) -> f64 {
    let (at, expected) = (state.position(&found.aligned.pose), state.motion.filter.position());
    (at[0] - expected[0]).hypot(at[1] - expected[1])
}

pub(super) fn position_std(state: &State) -> f64 {
    (0.5 * (state.motion.filter.p[0][(0, 0)] + state.motion.filter.p[1][(0, 0)])).sqrt().clamp(0.2, 3.0)
}
