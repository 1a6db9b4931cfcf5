//! A target that has long counted as covered although it only has another size.
//!
//! The size of a covered target is held, so a wrong size leaves less and less of it where it is expected,
//! which looks like cover again. An occluder leaves a part of the outline visible; a target of another size
//! fits all around, and leaves nothing of itself beside it.

use super::alignment::Alignment;
use super::finding::{Finding, LEVELS, MIN_VISIBILITY_LOSS, MIN_VISIBILITY_TO_LEARN, PRIOR, RESIZED, try_at};
use super::layers::{CORE, grown};
use super::oriented_box::OrientedBox;
use super::pose::Pose;
use super::samples::MAX_RESIDUAL;
use super::score::{Score, is_hit, view};
use super::search::search;
use super::state::State;
use super::task::VoteMask;
use crate::types::{Frame, TargetBox};

/// Frames in a row after which cover is doubted.
const MIN_OCCLUDED_FRAMES: usize = 8;
/// Maximum share of the area that looks like the target beside it, or is left out; cover leaves more.
const MAX_LEFT_OUT_SHARE: f64 = 0.15;
/// Sizes that are tried, over the one that is held, in this order.
const SIZES: [f64; 5] = [0.9, 1.1, 0.8, 1.25, 1.0];
/// Frames from one of them to the next.
const FRAMES_PER_SIZE: usize = 2;
/// Farthest from where it is expected, px.
const REACH: usize = 12;
/// What a part of the target that is not seen counts as, grey levels.
const UNSEEN: f64 = 6.0;

/// The target at another size where that explains more than cover; one size per frame bounds the time.
pub(super) fn locate_resized(state: &State, frame: &Frame<f64>, covered: &Finding) -> Option<Finding> {
    if state.history.occluded_frames < MIN_OCCLUDED_FRAMES
        || !(state.history.occluded_frames - MIN_OCCLUDED_FRAMES).is_multiple_of(FRAMES_PER_SIZE)
    {
        return None;
    }
    let expected = covered.aligned.pose;
    let size = SIZES[(state.history.occluded_frames - MIN_OCCLUDED_FRAMES) / FRAMES_PER_SIZE % SIZES.len()];
    let guess =
        state.placed(Pose { a: expected.a.map(|row| row.map(|a| size * a)), ..expected }, state.position(&expected));
    let place = search(frame, &state.target, &state.background, (&guess, 1.0), REACH)?;
    let found = try_at(state, frame, &place, (state.motion_model, VoteMask::None, PRIOR, &LEVELS[1..]))?;
    let around = grown(state.reached(&expected), (0.2, REACH as f64));
    let [left, before] = [&found, covered].map(|finding| unexplained(state, frame, finding, &around));
    let taken = left < before
        && fits(&found.score, &covered.score)
        && left_over(state, frame, covered, &found) < MAX_LEFT_OUT_SHARE;
    taken.then_some(Finding { reason: RESIZED, ..found })
}

/// What target and background together leave unexplained of a part of the picture, large differences
/// counting alike; grey levels. Of a covered target any part may be hidden.
pub(super) fn unexplained(state: &State, frame: &Frame<f64>, found: &Finding, around: &TargetBox) -> f64 {
    let Alignment { pose, gain, .. } = found.aligned;
    let [[a, b], [c, d]] = pose.a;
    let determinant = a * d - b * c;
    let (columns, rows) = (state.target.half()[0], state.target.half()[1]);
    let [low, high] = pixels(around, frame.size());
    let (mut sum, mut count) = (0.0, 0.0);
    for y in low[1]..high[1] {
        for x in low[0]..high[0] {
            let [dx, dy] = [x as f64 - pose.p[0], y as f64 - pose.p[1]];
            let [i, j] = [(d * dx - b * dy) / determinant + columns, (a * dy - c * dx) / determinant + rows];
            let behind = state.background.picture.get(x, y);
            let on = i >= 0.0 && j >= 0.0 && i <= 2.0 * columns && j <= 2.0 * rows;
            let model = if on {
                let at = [(i + 0.5) as usize, (j + 0.5) as usize];
                let support = state.target.a.get(at[0], at[1]);
                support * gain * state.target.t.get(at[0], at[1]) + (1.0 - support) * behind
            } else {
                behind
            };
            let seen = frame.get(x, y);
            let hidden = if found.occluded { (seen - behind).abs() + UNSEEN } else { MAX_RESIDUAL };
            sum += (seen - model).abs().min(hidden).min(MAX_RESIDUAL);
            count += 1.0;
        }
    }
    sum / f64::max(count, 1.0)
}

/// Area of the held outline that shows the target and that another size leaves out, over the target's area at
/// that size. Between fence bars a small target fits as well, but leaves out more.
pub(super) fn left_over(state: &State, frame: &Frame<f64>, held: &Finding, resized: &Finding) -> f64 {
    let Alignment { pose, gain, .. } = held.aligned;
    let other = resized.aligned.pose;
    let sides = state.target.extent();
    let outline = OrientedBox::about(state.position(&other), &other, sides, (0.0, 0.0));
    let shown = view(frame, &state.target, &state.background, &pose);
    let places = state.target.places(&pose);
    let left_out = state.target.a.data().iter().zip(state.target.t.data()).enumerate().filter(|&(at, (&a, &t))| {
        let (bright, behind) = (gain * t, shown.behind[at]);
        let clear = (bright - behind).abs() > 4.0 * state.scene.noise;
        a > CORE
            && clear
            && is_hit(shown.seen[at], bright, behind, state.scene.noise)
            && !outline.contains(places.get(at))
    });
    let growth = other.scale() / pose.scale();
    left_out.count() as f64 / (sides[0] * sides[1] * growth * growth)
}

fn fits(score: &Score, covered: &Score) -> bool {
    score.visibility >= MIN_VISIBILITY_TO_LEARN
        && score.visibility > covered.visibility + MIN_VISIBILITY_LOSS
        && score.leak < MAX_LEFT_OUT_SHARE
}

fn pixels(bounds: &TargetBox, (width, height): (usize, usize)) -> [[usize; 2]; 2] {
    let within = |at: f64, length: usize| at.ceil().clamp(0.0, length as f64) as usize;
    [
        [within(bounds.x, width), within(bounds.y, height)],
        [within(bounds.x + bounds.width, width), within(bounds.y + bounds.height, height)],
    ]
}
