//! Beginning anew where something still hid part of the target in the first frame: that part is the target's
//! all the same, but is not known yet, and what hides it is known.

use super::find::{ADAPTED, YOUNG};
use super::front::Front;
use super::layers::{Background, Target, UNSEEN, grown, holds};
use super::learn::{self, CONTINUED, SOLID};
use super::outset::{Outset, Uncovered};
use super::patch::smooth_known;
use super::pose::Pose;
use super::refit::TURNED;
use super::{Layered, begun};
use crate::track::gradient::detect::MovingTarget;
use crate::types::{Frame, TargetBox};

/// Variance of the displacement since the first frame, which is told in whole pixels, px^2.
const WHOLE_PIXELS: f64 = 0.5;
/// Difference of displacements that whole pixels, and what is behind the target, may make, px.
const WHOLE: f64 = 2.0;
/// Deviation of the middle of what moved, whose sides are told to a pixel, px.
const UNSETTLED: f64 = 0.6;
/// Change in still places that noise does not make, over the noise.
const STILL: f64 = 4.0;

impl Layered {
    /// Looks whether the frame tells what the first box held.
    pub(super) fn look_back(&mut self, frame: &Frame<f64>, motion: [f64; 2]) {
        if motion != [0.0; 2] {
            self.front = None;
        }
        let Some(mut outset) = self.outset.take().filter(|_| motion == [0.0; 2]) else { return };
        match outset.tell(frame, self.noise) {
            Some(found) => self.begin_anew(&outset, &found, frame),
            None => match outset.outgrown(frame, self.noise).or_else(|| self.refitted(&outset, frame)) {
                Some(found) => self.begin_with(&found, frame, outset.frames()),
                None if outset.is_over() => {}
                None => self.outset = Some(outset),
            },
        }
    }

    /// The box of what moves, unless the target turned, which changes the outline as well. Its size says
    /// nothing: a box beside the target makes that seem to change.
    fn refitted(&self, outset: &Outset, frame: &Frame<f64>) -> Option<MovingTarget> {
        if self.turned.abs() < TURNED { outset.refitted(frame, self.noise) } else { None }
    }

    fn begin_anew(&mut self, outset: &Outset, found: &Uncovered, frame: &Frame<f64>) {
        let at = outset.bounds.centre();
        self.target = outset.target.clone();
        let ([x0, y0], (width, height)) = (outset.first.corner, found.hidden.size());
        self.target.hide(|xi| {
            let pixel = |at: f64, corner: usize, length: usize| {
                ((at + 0.5).floor() - corner as f64).clamp(0.0, length as f64 - 1.0) as usize
            };
            found.hidden.get(pixel(at[0] + xi[0], x0, width), pixel(at[1] + xi[1], y0, height))
        });
        self.background.begin_anew(outset, found, frame, STILL * self.noise);
        self.begin_at([at[0] + found.moved[0], at[1] + found.moved[1]], found.moved, found.frames);
        (self.hidden, self.age, self.adapts_until) = (true, YOUNG, 0);
        self.front = Front::of(outset, &found.hidden);
    }

    /// The first box was not that of what moves.
    fn begin_with(&mut self, found: &MovingTarget, frame: &Frame<f64>, frames: usize) {
        self.target = Target::new(frame, found.bounds, learn::PRIOR);
        self.background = Background::new(frame, found.bounds);
        let turned = self.turned;
        self.begin_at(found.bounds.centre(), found.displacement, frames);
        self.turned = turned;
        self.unsettled = [UNSETTLED; 2];
    }

    /// Begins at a place that was reached in so many frames, by a displacement in whole pixels.
    fn begin_at(&mut self, centre: [f64; 2], moved: [f64; 2], frames: usize) {
        self.pose = Pose::at(centre);
        self.filter = begun(centre);
        for (k, (x, p)) in self.filter.x.iter_mut().zip(&mut self.filter.p).enumerate() {
            x[1] = moved[k] / frames as f64;
            (p[(0, 0)], p[(1, 1)]) = (WHOLE_PIXELS, 1.0);
        }
        (self.rate, self.before, self.usual) = ([0.0; 6], None, 1.0);
        (self.missed, self.hidden, self.age, self.most_seen) = (0, false, 0, 0.0);
        (self.turned, self.wary, self.front) = (0.0, 0, None);
        (self.resting, self.sound, self.adapts_until) = (None, None, ADAPTED);
    }

    /// As long as the first box is not told from what it held besides, what is said of the way since then may
    /// be wrong by as much as the displacement of all that moved differs from it.
    pub(super) fn look_at_the_whole_way(&mut self) {
        let told = self.outset.as_ref().and_then(|outset| outset.moved().map(|moved| (moved, outset.bounds.centre())));
        let Some((moved, first)) = told else { return self.doubt = [0.0; 2] };
        let (at, size) = (self.filter.position(), self.target.size);
        // The sides of what grows move otherwise than its middle.
        let grown = (self.pose.scale() - 1.0).abs();
        self.doubt = [0, 1].map(|k| {
            let apart = (at[k] - first[k] - moved[k]).abs();
            if apart > WHOLE + 0.5 * grown * size[k] { apart } else { 0.0 }
        });
    }
}

impl Target {
    /// Points that are not known: they are guessed to be like those nearest to them.
    fn hide(&mut self, hidden: impl Fn([f64; 2]) -> bool) {
        let (width, height) = self.a.size();
        let hidden = Frame::from_fn(width, height, |i, j| hidden(self.xi(i, j)));
        let hidden = super::level::dilated(&hidden, 1);
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
    /// What was seen around the first box, and beside the target where that is `now`.
    fn begin_anew(&mut self, outset: &Outset, found: &Uncovered, frame: &Frame<f64>, bar: f64) {
        let bounds = outset.bounds;
        let there = TargetBox { x: bounds.x + found.moved[0], y: bounds.y + found.moved[1], ..bounds };
        let (first, now) = (grown(bounds, UNSEEN), grown(there, UNSEEN));
        let [x0, y0] = outset.first.corner;
        let (width, height) = found.hidden.size();
        for j in 0..height {
            for i in 0..width {
                let (x, y, was) = (x0 + i, y0 + j, outset.first.frame.get(i, j));
                let is = frame.get(x, y);
                let beside = !outset.inside.get(i, j) && (was - is).abs() < bar;
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
