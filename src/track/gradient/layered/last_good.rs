//! Keeps the last state before a target began to vanish, and goes on from there.
//!
//! The edge of an occluder is mistaken for the target's own: a similarity that follows it shrinks and lags,
//! and a filter that believes it misleads the search where the target reappears.

use super::{finding::Finding, finding::MIN_VISIBILITY_LOSS, state::LastGood, state::State};
use crate::types::TargetBox;

/// Frames after which the state from before is too old to go on from.
const MAX_FRAMES: usize = 6;
/// Part of the acceleration that is kept, as where a known surface covers the target.
pub(super) const DAMPED: f64 = 0.3;

/// After a measurement: keeps the state if the target was seen whole; `smaller`: it shrank as under cover.
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

/// In the first frame without the target: restores the last good state, unless it left the picture.
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
