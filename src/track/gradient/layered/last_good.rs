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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::CounterRng;
    use crate::track::gradient::layered::locate::locate;
    use crate::track::gradient::layered::score::Score;
    use crate::track::gradient::layered::update;
    use crate::track::gradient::options::GradientOptions;
    use crate::types::{Frame, TrackState};

    const SIDE: usize = 14;
    const SPEED: usize = 2;
    /// Frames until it begins to vanish.
    const SEEN: usize = 6;

    /// A square moving to the right before waves, with noise.
    fn frame(t: usize) -> Frame<f64> {
        let rng = CounterRng::new(t as u64 + 1);
        Frame::from_fn(120, 60, |x, y| {
            let on = (20 + SPEED * t..20 + SPEED * t + SIDE).contains(&x) && (20..20 + SIDE).contains(&y);
            let brightness = if on { 190.0 } else { 90.0 + 15.0 * (0.3 * x as f64).sin() * (0.25 * y as f64).cos() };
            brightness + 1.5 * rng.normal((120 * y + x) as u64)
        })
    }

    /// A tracker that has seen the square for a while, and what it found last.
    fn followed() -> (State, Finding) {
        let half = 0.5 * SIDE as f64;
        let first = TargetBox::about([19.5 + half, 19.5 + half], 2.0 * half, 2.0 * half);
        let mut tracker = State::new(frame(0), first, &GradientOptions::default());
        let mut state = TrackState::at(first.centre(), first);
        (1..=SEEN).for_each(|t| update(&mut tracker, Some(&frame(t)), &mut state));
        tracker.motion.filter.predict();
        let found = locate(&tracker, &frame(SEEN + 1)).unwrap();
        assert!(!found.occluded, "{found:?}");
        let whole = Score { visibility: 1.0, ..found.score };
        (tracker, Finding { score: whole, ..found })
    }

    /// What an edge that covers the square makes of a measurement: it stays behind and shrinks.
    fn mislead(tracker: &mut State, found: &Finding) {
        tracker.motion.filter.predict();
        tracker.motion.filter.x[0][0] -= 3.0;
        tracker.motion.filter.x[0][1] = 0.5;
        tracker.motion.filter.x[0][2] = -1.0;
        tracker.motion.pose.a = [[0.7, 0.1], [-0.1, 0.7]];
        tracker.motion.rotation = 0.4;
        keep_last_good(tracker, found, true);
    }

    #[test]
    fn what_vanishes_goes_on_from_before_it_shrank() {
        let (mut tracker, found) = followed();
        keep_last_good(&mut tracker, &found, false);
        let (at, pose, turned) = (tracker.motion.filter.position(), tracker.motion.pose, tracker.motion.rotation);
        (0..3).for_each(|_| mislead(&mut tracker, &found));
        tracker.motion.filter.predict();
        restore_last_good(&mut tracker);
        let now = tracker.motion.filter.position();
        let reached = at[0] + 4.0 * SPEED as f64;
        assert!((now[0] - reached).abs() < 0.5 && (now[1] - at[1]).abs() < 0.3, "{now:?}, not {reached}");
        assert!((tracker.motion.filter.speed()[0] - SPEED as f64).abs() < 0.2, "{:?}", tracker.motion.filter.speed());
        assert_eq!((tracker.motion.pose.a, tracker.motion.rotation), (pose.a, turned));
    }

    #[test]
    fn what_was_measured_is_kept_where_nothing_misled_it() {
        let changed = |prepare: &dyn Fn(&mut State, &Finding)| {
            let (mut tracker, found) = followed();
            keep_last_good(&mut tracker, &found, false);
            prepare(&mut tracker, &found);
            let before = (tracker.motion.filter.clone(), tracker.motion.pose, tracker.motion.rotation);
            restore_last_good(&mut tracker);
            before != (tracker.motion.filter, tracker.motion.pose, tracker.motion.rotation)
        };
        assert!(changed(&mislead), "the scene of this test says nothing");
        assert!(!changed(&|_, _| {}), "it vanished at once");
        assert!(!changed(&|tracker, found| (0..=MAX_FRAMES).for_each(|_| mislead(tracker, found))), "that is long ago");
        assert!(
            !changed(&|tracker, found| {
                mislead(tracker, found);
                tracker.history.missed = 1;
            }),
            "it was not seen in the frame before either"
        );
        assert!(
            !changed(&|tracker, found| {
                mislead(tracker, found);
                tracker.motion.pose.p[0] = 118.0;
            }),
            "it leaves the picture"
        );
        assert!(
            !changed(&|tracker, found| keep_last_good(tracker, &Finding { occluded: true, ..*found }, false)),
            "its cover was known, and nothing was taken for all of it"
        );
    }
}
