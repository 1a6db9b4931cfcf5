//! The target in a frame: where the filter expects it, beside what covers or touches it, or all around.

use super::finding::{
    DOUBTED_INNOVATION, Finding, LEVELS, MAX_UNDOUBTED_INNOVATION, MIN_CONTRAST_PER_NOISE, MIN_VISIBILITY,
    MIN_VISIBILITY_LOSS, MIN_VISIBILITY_TO_LEARN, PRIOR, SEARCHED, TOUCHED, try_at,
};
use super::initial::WHOLE_PIXEL_TOLERANCE;
use super::occlusion::{
    is_emerging, is_settled, locate_emerging, locate_entering_occlusion, locate_occluded, may_be_held_back,
    position_std,
};
use super::reshaped::locate_reshaped;
use super::resized::locate_resized;
use super::scene::shift;
use super::search::search;
use super::state::{MIN_SCALE_CHANGE, State};
use super::task::{MotionModel, VoteMask};
use crate::types::Frame;

/// That of size and angle where a look-alike touches, whose pull may go a long way with the target.
pub(super) const STIFF: f64 = 0.005;
/// Standard deviation of a displacement in whole pixels, px.
const DISPLACEMENT_STD: f64 = 1.0;
/// Below this visibility it is looked for all around.
pub(super) const MIN_VISIBILITY_WITHOUT_SEARCH: f64 = 0.6;
/// The same from which on, on one side, a look-alike touches.
pub(super) const TOUCH: (f64, f64) = (0.08, 0.6);
pub(super) const TOUCHED_BEFORE: &str = "a similar object was adjacent in a recent frame";
/// Reach of the search, px: at first, and at most.
pub(super) const REACH: (usize, usize) = (12, 36);

/// The target in the frame, if it is seen well enough to be measured.
pub(super) fn locate(state: &State, frame: &Frame<f64>) -> Option<Finding> {
    if is_emerging(state) {
        return locate_emerging(state, frame).or_else(|| search_around(state, frame));
    }
    let interrupted = state.history.occluded || state.history.missed > 0;
    let levels = if state.history.age > 0 && state.history.missed == 0 { &LEVELS[1..] } else { &LEVELS[..] };
    let plain = try_at(state, frame, &state.expected(), (state.motion_model, VoteMask::None, PRIOR, levels));
    let plain = locate_returning(state, frame, plain.as_ref(), levels).or(plain);
    let plain = locate_displaced(state, frame, plain.as_ref()).or(plain);
    let mut best = plain;
    let doubted = crate::ablation::keeps("gradient.occlusion")
        && plain.is_none_or(|found| {
            found.score.visibility < MIN_VISIBILITY_TO_LEARN
                || found.nis > DOUBTED_INNOVATION
                || state.has_shrunk(&found.aligned.pose)
        });
    let held_back = plain.filter(|plain| {
        crate::ablation::keeps("gradient.held_back") && is_settled(state) && may_be_held_back(state, plain)
    });
    if (doubted || interrupted || held_back.is_some())
        && is_settled(state)
        && crate::ablation::keeps("gradient.occlusion")
    {
        let begun = || {
            held_back
                .filter(|_| crate::ablation::keeps("gradient.begun_cover"))
                .and_then(|plain| locate_entering_occlusion(state, frame, &plain))
        };
        best = locate_occluded(state, frame, plain, levels).or_else(begun).or(best);
    }
    if let Some(plain) = plain.filter(|_| state.history.age > 0 && crate::ablation::keeps("gradient.reshaped")) {
        best = locate_reshaped(state, frame, &plain, levels).or(best);
    }
    let touched = best
        .filter(|found| crate::ablation::keeps("gradient.look_alike") && is_settled(state) && !found.occluded)
        .and_then(|found| look_alike_reason(state, &found));
    if let Some(reason) = touched {
        best = locate_beside_look_alike(state, frame, levels, reason).or(best);
    }
    if best.is_none_or(|found| found.score.visibility < MIN_VISIBILITY_WITHOUT_SEARCH && !found.occluded) {
        best = search_around(state, frame).or(best);
    }
    if let Some(covered) = best.filter(|found| found.occluded) {
        best = locate_resized(state, frame, &covered).filter(|_| crate::ablation::keeps("gradient.resized")).or(best);
    }
    let least = MIN_VISIBILITY[usize::from(state.history.missed > 0)];
    best.filter(|found| {
        found.score.visibility >= least
            && (!crate::ablation::keeps("gradient.minimum_contrast")
                || found.score.contrast >= MIN_CONTRAST_PER_NOISE * state.scene.noise)
    })
}

/// A target that reappears: the visible part would fit a smaller one, so the size is held.
fn locate_returning(state: &State, frame: &Frame<f64>, plain: Option<&Finding>, levels: &[f64]) -> Option<Finding> {
    let returns = state.history.missed > 0 || state.history.reappearing > 0;
    if !returns || !state.has_shrunk(&plain?.aligned.pose) || !crate::ablation::keeps("gradient.returning_size") {
        return None;
    }
    try_at(state, frame, &state.expected(), (MotionModel::Translation, VoteMask::None, PRIOR, levels))
}

/// The target where the changes since the first frame say that it is, if it was found elsewhere: its speed
/// is not known yet, and gradient steps from rest may lead to the wrong side of a rough background.
fn locate_displaced(state: &State, frame: &Frame<f64>, plain: Option<&Finding>) -> Option<Finding> {
    let initial = state.initial.as_ref().filter(|_| crate::ablation::keeps("gradient.start_drift"))?;
    let (first, moved) = (initial.bounds.centre(), initial.moved()?);
    let there = [first[0] + moved[0], first[1] + moved[1]];
    let is_there = |found: &Finding| {
        let at = state.position(&found.aligned.pose);
        (at[0] - there[0]).hypot(at[1] - there[1]) <= WHOLE_PIXEL_TOLERANCE
    };
    if plain.is_some_and(is_there) {
        return None;
    }
    let how = (state.motion_model, VoteMask::None, [DISPLACEMENT_STD, PRIOR[1]], &LEVELS[2..]);
    let found = try_at(state, frame, &state.placed(state.motion.pose, there), how)?;
    let least = plain.map_or(1.0, |plain| plain.score.visibility - MIN_VISIBILITY_LOSS).min(MIN_VISIBILITY_TO_LEARN);
    (is_there(&found) && found.score.visibility >= least).then_some(found)
}

/// Whether a look-alike touches the target on one side, or did a moment ago and may still pull it. This ends
/// by itself: size and position are held meanwhile, and would differ the more the longer it lasts.
pub(super) fn look_alike_reason(state: &State, found: &Finding) -> Option<&'static str> {
    if found.score.leak > TOUCH.0 && found.score.one_sided > TOUCH.1 {
        return Some(TOUCHED);
    }
    let grown = (found.aligned.pose.scale() / state.motion.pose.scale() - 1.0).abs() > MIN_SCALE_CHANGE;
    (state.history.look_alike_cooldown > 0
        && crate::ablation::keeps("gradient.look_alike_cooldown")
        && (found.nis > MAX_UNDOUBTED_INNOVATION || grown))
        .then_some(TOUCHED_BEFORE)
}

pub(super) fn locate_beside_look_alike(
    state: &State,
    frame: &Frame<f64>,
    levels: &[f64],
    reason: &'static str,
) -> Option<Finding> {
    let how = (
        state.motion_model,
        VoteMask::LookAlike,
        [position_std(state), if crate::ablation::keeps("gradient.look_alike_stiff") { STIFF } else { PRIOR[1] }],
        levels,
    );
    let found = try_at(state, frame, &state.expected(), how)?;
    Some(Finding { occluded: true, reason, ..found })
}

pub(super) fn search_around(state: &State, frame: &Frame<f64>) -> Option<Finding> {
    if !crate::ablation::keeps("gradient.search") {
        return None;
    }
    let reach = (REACH.0 + state.history.missed).min(REACH.1);
    let guess = state.expected();
    let place = search(frame, &state.target, &state.background, (&guess, 1.0), reach)?;
    let how = (MotionModel::Translation, VoteMask::None, PRIOR, &LEVELS[1..]);
    let found = try_at(state, frame, &place, how)?;
    (found.score.visibility >= MIN_VISIBILITY_TO_LEARN).then_some(Finding { reason: SEARCHED, ..found })
}

/// Usually the target moves with the scene under a moving camera; in doubt, a camera that follows is tried.
pub(super) fn locate_with_camera(state: &mut State, frame: &Frame<f64>, motion: [f64; 2]) -> Option<Finding> {
    let against = motion.map(|m| -m);
    if motion != [0.0; 2] && state.motion.rides_camera {
        shift(state, against);
    }
    let first = locate(state, frame);
    let nis =
        |found: &Option<Finding>| found.map_or(f64::INFINITY, |f| if f.occluded { DOUBTED_INNOVATION } else { f.nis });
    if !crate::ablation::keeps("gradient.with_camera") || motion == [0.0; 2] || nis(&first) < MAX_UNDOUBTED_INNOVATION {
        return first;
    }
    let (there, back) = if state.motion.rides_camera { (motion, against) } else { (against, motion) };
    shift(state, there);
    let second = locate(state, frame);
    if nis(&second) < nis(&first) {
        state.motion.rides_camera = !state.motion.rides_camera;
        return second;
    }
    shift(state, back);
    first
}
