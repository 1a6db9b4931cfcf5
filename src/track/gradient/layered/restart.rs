//! Starts again where an object at rest hid part of the target in the first frame: that part is the target's
//! all the same, but is not known yet, and what hides it is known.

use super::finding::SETTLING_FRAMES;
use super::initial::{InitialSegmentation, WHOLE_PIXEL_TOLERANCE};
use super::layers::{Background, PRIOR, Target, UNSEEN, grown, holds};
use super::learn::{CONTINUED, SOLID};
use super::occluder::{HiddenPart, find_occluder};
use super::patch::{dilated, smooth_known};
use super::pose::Pose;
use super::refit::TURNED;
use super::state::{MAX_SETTLING_FRAMES, State, start_filter};
use crate::track::gradient::detect::MovingTarget;
use crate::types::{Frame, TargetBox};

/// Variance of the displacement since the first frame, which is in whole pixels, px^2.
const WHOLE_PIXEL_VARIANCE: f64 = 0.5;
/// Standard deviation of the middle of what moved, whose sides are known to a pixel, px.
const CENTER_STD: f64 = 0.6;
/// Change in still places that noise does not make, over the noise.
const STILL_CHANGE_PER_NOISE: f64 = 4.0;

/// Looks whether the frame decides what the first box held.
pub(super) fn resolve_initial(state: &mut State, frame: &Frame<f64>, motion: [f64; 2]) {
    let Some(mut segmentation) = state.initial.take().filter(|_| motion == [0.0; 2]) else { return };
    match find_occluder(&mut segmentation, frame, state.scene.noise) {
        Some(found) => restart_occluded(state, &segmentation, &found, frame),
        None => {
            match box_of_motion(state, &segmentation, frame)
                .filter(|_| crate::ablation::keeps("gradient.start_refitted"))
            {
                Some(found) => restart_with_box(state, &found, frame, segmentation.frames()),
                None if segmentation.is_over() => {}
                None => state.initial = Some(segmentation),
            }
        }
    }
}

/// Box of what moves, unless the target turned; the size says nothing, since a box that is off changes it.
pub(super) fn box_of_motion(
    state: &State,
    segmentation: &InitialSegmentation,
    frame: &Frame<f64>,
) -> Option<MovingTarget> {
    if state.motion.rotation.abs() < TURNED { segmentation.refitted(frame, state.scene.noise) } else { None }
}

pub(super) fn restart_occluded(
    state: &mut State,
    segmentation: &InitialSegmentation,
    found: &HiddenPart,
    frame: &Frame<f64>,
) {
    let at = segmentation.bounds.centre();
    state.target = segmentation.target.clone();
    let ([x0, y0], (width, height)) = (segmentation.first.corner, found.hidden.size());
    state.target.hide(|xi| {
        let pixel = |at: f64, corner: usize, length: usize| {
            ((at + 0.5).floor() - corner as f64).clamp(0.0, length as f64 - 1.0) as usize
        };
        found.hidden.get(pixel(at[0] + xi[0], x0, width), pixel(at[1] + xi[1], y0, height))
    });
    state.background.begin_anew(segmentation, found, frame, STILL_CHANGE_PER_NOISE * state.scene.noise);
    restart_at(state, [at[0] + found.moved[0], at[1] + found.moved[1]], found.moved, found.frames);
    (state.history.occluded, state.history.age, state.history.adapts_until) = (true, SETTLING_FRAMES, 0);
}

pub(super) fn restart_with_box(state: &mut State, found: &MovingTarget, frame: &Frame<f64>, frames: usize) {
    state.target = Target::new(frame, found.bounds, PRIOR);
    state.background = Background::new(frame, found.bounds);
    let turned = state.motion.rotation;
    restart_at(state, found.bounds.centre(), found.displacement, frames);
    state.motion.rotation = turned;
    state.uncertainty.outline = [CENTER_STD; 2];
}

/// Begins at a place that was reached in so many frames, by a displacement in whole pixels.
pub(super) fn restart_at(state: &mut State, centre: [f64; 2], moved: [f64; 2], frames: usize) {
    state.motion.pose = Pose::at(centre);
    state.motion.filter = start_filter(centre);
    for (k, (x, p)) in state.motion.filter.x.iter_mut().zip(&mut state.motion.filter.p).enumerate() {
        x[1] = moved[k] / frames as f64;
        (p[(0, 0)], p[(1, 1)]) = (WHOLE_PIXEL_VARIANCE, 1.0);
    }
    (state.motion.last_position, state.history.mean_visibility) = (None, 1.0);
    (state.history.missed, state.history.occluded, state.history.age, state.history.max_visibility) =
        (0, false, 0, 0.0);
    (state.motion.rotation, state.history.look_alike_cooldown) = (0.0, 0);
    (state.last_good, state.history.adapts_until) = (None, MAX_SETTLING_FRAMES);
}

/// While the first box is undecided, the displacement may be off by its distance from that of all that moved.
pub(super) fn update_displacement_uncertainty(state: &mut State) {
    let told = state
        .initial
        .as_ref()
        .and_then(|segmentation| segmentation.moved().map(|moved| (moved, segmentation.bounds.centre())));
    let Some((moved, first)) = told else { return state.uncertainty.displacement = [0.0; 2] };
    let (at, size) = (state.motion.filter.position(), state.target.size);
    // The sides of what grows move differently from its middle.
    let grown = (state.motion.pose.scale() - 1.0).abs();
    state.uncertainty.displacement = [0, 1].map(|k| {
        let apart = (at[k] - first[k] - moved[k]).abs();
        if crate::ablation::keeps("gradient.start_doubt") && apart > WHOLE_PIXEL_TOLERANCE + 0.5 * grown * size[k] {
            apart
        } else {
            0.0
        }
    });
}

impl Target {
    /// Points that are not known: they are guessed to be like those nearest to them.
    fn hide(&mut self, hidden: impl Fn([f64; 2]) -> bool) {
        let (width, height) = self.a.size();
        let hidden = Frame::from_fn(width, height, |i, j| hidden(self.xi(i, j)));
        let hidden = dilated(&hidden, 1);
        let known = |i, j| self.a.get(i, j) > SOLID && !hidden.get(i, j);
        let mut t = Frame::from_fn(width, height, |i, j| if known(i, j) { self.t.get(i, j) } else { f64::NAN });
        let mut reach = CONTINUED;
        while t.data().iter().any(|t| t.is_nan()) && reach < 2.0 * width.max(height) as f64 {
            let smooth = smooth_known(&t, reach);
            t.data_mut().iter_mut().zip(smooth.data()).filter(|(t, _)| t.is_nan()).for_each(|(t, s)| *t = *s);
            reach *= 2.0;
        }
        for (own, t) in self.t.data_mut().iter_mut().zip(t.data()) {
            *own = if t.is_nan() { *own } else { *t };
        }
        self.fresh = Some(hidden.map(|hidden| f64::from(u8::from(*hidden))));
    }
}

impl Background {
    fn begin_anew(&mut self, segmentation: &InitialSegmentation, found: &HiddenPart, frame: &Frame<f64>, bar: f64) {
        let bounds = segmentation.bounds;
        let there = TargetBox { x: bounds.x + found.moved[0], y: bounds.y + found.moved[1], ..bounds };
        let (first, now) = (grown(bounds, UNSEEN), grown(there, UNSEEN));
        let [x0, y0] = segmentation.first.corner;
        let (width, height) = found.hidden.size();
        for j in 0..height {
            for i in 0..width {
                let (x, y, was) = (x0 + i, y0 + j, segmentation.first.frame.get(i, j));
                let is = frame.get(x, y);
                let beside = !segmentation.inside.get(i, j) && (was - is).abs() < bar;
                let (value, known) = if !holds(&first, x, y) || found.hidden.get(i, j) || beside {
                    (was, true)
                } else {
                    (is, !holds(&now, x, y))
                };
                (self.picture.row_mut(y)[x], self.known.row_mut(y)[x]) = (value, known);
            }
        }
        self.guess(&now, |_, _| false);
    }
}
