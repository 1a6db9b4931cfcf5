//! A target that vanishes soon after it was seen less or became smaller: an object had begun to cover it, and
//! what was measured meanwhile was the rest of it.
//!
//! The edge of what covers a target stands for the target's own; a similarity that follows it shrinks and
//! stays behind, and a filter that believed it leads the search away from where the target comes out again.
//! The last state before that is therefore kept, and what vanishes goes on from there.

use super::finding::{Finding, MIN_VISIBILITY_LOSS};
use super::state::{LastGood, State};
use crate::types::TargetBox;

/// Frames after which the state from before is too old to go on from.
const MAX_FRAMES: usize = 6;
/// Part of the acceleration that is kept, as where a known surface covers the target.
pub(super) const DAMPED: f64 = 0.3;

/// After a measurement: keeps the state if the target was seen whole; `smaller`: it shrank by what cover
/// makes of it.
pub(super) fn keep_last_good(state: &mut State, found: &Finding, smaller: bool) {
    let whole =
        !found.occluded && !smaller && found.score.visibility >= state.history.mean_visibility - MIN_VISIBILITY_LOSS;
    if whole {
        state.last_good = Some(LastGood {
            filter: state.motion.filter.clone(),
            pose: state.motion.pose,
            turned: state.motion.rotation,
            frames: 0,
            followed: false,
        });
    } else if let Some(sound) = &mut state.last_good {
        sound.frames += 1;
        sound.followed |= !found.occluded;
    }
}

/// At the first frame in which the target is not seen any more: goes on from before it began to vanish,
/// where that was not noticed. What leaves the picture is not covered: what was measured of it is right.
pub(super) fn restore_last_good(state: &mut State) {
    let TargetBox { x, y, width, height } = state.reached(&state.motion.pose);
    let (columns, rows) = state.scene.previous.frame.size();
    let inside = x >= -0.5 && y >= -0.5 && x + width <= columns as f64 - 0.5 && y + height <= rows as f64 - 0.5;
    if state.history.missed > 0 || !inside {
        return;
    }
    let Some(sound) = state.last_good.take().filter(|sound| sound.followed && sound.frames <= MAX_FRAMES) else {
        return;
    };
    state.motion.filter = sound.filter;
    state.motion.filter.x.iter_mut().for_each(|x| x[2] *= DAMPED);
    (0..=sound.frames).for_each(|_| state.motion.filter.predict());
    (state.motion.pose.a, state.motion.rotation) = (sound.pose.a, sound.turned);
}
