//! Finding the target in a frame: where the filter expects it, beside what covers or touches it, or all
//! around.

use super::align::{Aligned, Freedom, Silence, Task, align};
use super::look::{Look, look, view};
use super::pose::Pose;
use super::search;
use super::{Layered, SURE};
use crate::types::Frame;

/// Deviations of the increment from the prediction: of the position, px, and of size and angle.
pub(super) const PRIOR: [f64; 2] = [3.0, 0.02];
/// That of size and angle where a look-alike touches, whose pull may go a long way with the target.
const STIFF: f64 = 0.005;
/// Levels of a frame like the one before, and of one after an interruption; px.
pub(super) const LEVELS: [f64; 4] = [4.0, 2.0, 1.0, 0.5];
/// Least visibility of a target that is seen well.
pub(super) const WELL: f64 = 0.75;
/// Below this visibility it is looked for all around.
const BADLY: f64 = 0.6;
/// Least visibility that is measured; and after a miss.
pub(super) const LEAST: [f64; 2] = [0.35, 0.5];
/// Innovation squared from which on a measurement is doubted.
pub(super) const DOUBT: f64 = 12.0;
/// Least visibility of a target that is known to be hidden in part.
const FEWEST: f64 = 0.1;
/// Frames in which the support is still adapting to what the box holds.
pub(super) const YOUNG: usize = 6;
/// Frames after which it is done with that, whatever is seen.
pub(super) const ADAPTED: usize = 20;
/// Least difference of the target from what is behind it, over the noise.
const VISIBLE: f64 = 1.0;
/// What is said of a target that something hides in part.
pub(super) const COVERED: &str = "something covers the target";
/// Part of the target's area that may look like it beside it.
pub(super) const LEAK: f64 = 0.06;
/// The same from which on, on one side, a look-alike touches.
const TOUCH: (f64, f64) = (0.08, 0.6);
/// What is said then.
pub(super) const TOUCHED: &str = "something like the target touches it";
/// What is said where it did a moment ago, and its pull may still be felt.
const TOUCHED_BEFORE: &str = "something like the target touched it a moment ago";
/// What is said of a target that was looked for.
pub(super) const SEARCHED: &str = "found by looking all around";
/// Change of size from one frame to the next that a look-alike makes, or cover.
const GROWN: f64 = 0.04;
/// Loss of size from one frame to the next that only cover makes.
const SHRUNK: f64 = 0.1;
/// Loss of visibility that is one.
pub(super) const DROP: f64 = 0.08;
/// Visibility of a target of which nothing is hidden.
const WHOLE: f64 = 0.95;
/// Loss of visibility that noise alone may make.
const SLIGHT: f64 = 0.03;
/// Width of a strip along a side of the target that is begun to be covered, px: of smaller targets it is a
/// loss of visibility.
const STRIP: f64 = 1.25;
/// Distance of two poses that a covered edge makes, px.
const HELD_BACK: f64 = 0.5;
/// Reach of the search, px: at first, and at most.
const REACH: (usize, usize) = (12, 36);

/// What a frame says of the target.
#[derive(Debug, Clone, Copy)]
pub(super) struct Finding {
    pub aligned: Aligned,
    pub look: Look,
    /// Normalised innovation squared.
    pub nis: f64,
    pub occluded: bool,
    pub reason: &'static str,
}

impl Layered {
    pub(super) fn nis(&self, pose: &Pose) -> f64 {
        let (at, expected) = (self.position(pose), self.filter.position());
        (0..2).map(|k| (at[k] - expected[k]).powi(2) / (self.filter.p[k][(0, 0)] + 0.02)).sum()
    }

    /// Aligns and judges.
    pub(super) fn try_at(
        &self,
        frame: &Frame<f64>,
        guess: &Pose,
        how: (Freedom, Silence, [f64; 2], &[f64]),
    ) -> Option<Finding> {
        let (freedom, silence, prior, levels) = how;
        let task = Task {
            frame,
            target: &self.target,
            background: &self.background,
            front: self.front.as_ref(),
            noise: self.noise,
            freedom,
            silence,
            prior,
            levels,
        };
        let aligned = align(task, guess, 1.0)?;
        let view = view(frame, &self.target, &self.background, &aligned.pose);
        let look = look(&self.target, &view, aligned.gain, self.noise);
        Some(Finding { nis: self.nis(&aligned.pose), aligned, look, occluded: false, reason: "" })
    }

    /// The target in the frame, if it is seen well enough to be measured.
    pub(super) fn find(&self, frame: &Frame<f64>) -> Option<Finding> {
        if self.front.is_some() {
            return self.behind_the_front(frame).or_else(|| self.searched(frame));
        }
        let interrupted = self.hidden || self.missed > 0;
        let levels = if self.age > 0 && self.missed == 0 { &LEVELS[1..] } else { &LEVELS[..] };
        let plain = self.try_at(frame, &self.expected(!interrupted), (self.freedom, Silence::None, PRIOR, levels));
        let plain = self.instead_of_astray(frame, plain.as_ref()).or(plain);
        let mut best = plain;
        let doubted = plain.is_none_or(|found| {
            found.look.visibility < WELL || found.nis > DOUBT || self.became_smaller(&found.aligned.pose)
        });
        let held_back = plain.filter(|plain| self.is_known() && self.may_be_held_back(plain));
        if (doubted || interrupted || held_back.is_some()) && self.is_known() {
            let begun = || held_back.and_then(|plain| self.begun(frame, &plain));
            best = self.covered(frame, plain, levels).or_else(begun).or(best);
        }
        if let Some(plain) = plain.filter(|_| self.age > 0) {
            best = self.reshaped(frame, &plain, levels).or(best);
        }
        let tells_look_alikes = self.is_known() || self.most_seen > WHOLE;
        let touched =
            best.filter(|found| tells_look_alikes && !found.occluded).and_then(|found| self.is_touched(&found));
        if let Some(reason) = touched {
            best = self.touched(frame, levels, reason).or(best);
        }
        // What comes out where it is expected is seen badly at first.
        let comes_out = |found: &Finding| self.returning > 0 && self.missed == 0 && found.nis < DOUBT;
        if best.is_none_or(|found| found.look.visibility < BADLY && !found.occluded && !comes_out(&found)) {
            best = self.searched(frame).or(best);
        }
        if let Some(covered) = best.filter(|found| found.occluded) {
            best = self.resized(frame, &covered).or(best);
        }
        let best = best.filter(|found| !self.is_a_rest(found));
        let least = LEAST[usize::from(self.missed > 0)];
        best.filter(|found| found.look.visibility >= least && found.look.contrast >= VISIBLE * self.noise)
    }

    /// Whether what was found is only what is left of a target that was covered or not seen in the frame
    /// before, for the edge of what covers it stands for its own: it is seen badly and became smaller, by
    /// much, or, right after it was covered, by less but off its way. Such a target is not seen; its way
    /// would end at that edge.
    fn is_a_rest(&self, found: &Finding) -> bool {
        let pose = &found.aligned.pose;
        let off = found.nis > DOUBT && found.look.leak < LEAK && self.became_smaller(pose);
        let shrunk = pose.scale() < (1.0 - SHRUNK) * self.pose.scale();
        let was_hidden = self.hidden || self.missed > 0;
        !found.occluded && found.look.visibility < WELL && (self.hidden && off || was_hidden && shrunk)
    }

    /// Whether the target is smaller than in the frame before by what cover makes of it.
    pub(super) fn became_smaller(&self, pose: &Pose) -> bool {
        pose.scale() < (1.0 - GROWN) * self.pose.scale()
    }

    /// The target comes out from what hid part of it in the first frame, or goes behind it: its size is that
    /// of the first box.
    fn behind_the_front(&self, frame: &Frame<f64>) -> Option<Finding> {
        let how = (Freedom::Translation, Silence::Front, PRIOR, &LEVELS[1..]);
        let found = self.try_at(frame, &self.expected(false), how)?;
        let whole = found.look.visibility > 1.0 - if self.is_large() { SLIGHT } else { DROP };
        let seen = found.look.visibility >= FEWEST && found.look.contrast >= VISIBLE * self.noise;
        let reason = if whole { "" } else { COVERED };
        seen.then_some(Finding { occluded: !whole, reason, ..found })
    }

    /// Something known covers the target: only its position is looked for, where it is not covered.
    fn covered(&self, frame: &Frame<f64>, plain: Option<Finding>, levels: &[f64]) -> Option<Finding> {
        let how = (Freedom::Translation, Silence::Covered, [self.spread(), PRIOR[1]], levels);
        let found = self.try_at(frame, &self.expected(false), how)?;
        let dropped = |look: &Look, by: f64| look.visibility < self.usual - by;
        // What is seen as well as ever in a place that nobody expected has made a turn; unless it became
        // smaller at that, as what lies between the bars of a fence.
        let turned = |plain: &Finding| {
            plain.nis > DOUBT && !dropped(&plain.look, SLIGHT) && !self.became_smaller(&plain.aligned.pose)
        };
        // Nor has one that is where it is expected but for a strip along its side, and would be smaller or
        // less seen elsewhere.
        let begins =
            plain.is_some_and(|plain| plain.nis > DOUBT && !turned(&plain) && self.is_held_back(&found, &plain));
        // The last strip of a large target is not to be taken for background.
        let drop = if begins || self.hidden && self.is_large() { SLIGHT } else { DROP };
        let also = plain.is_none_or(|plain| !turned(&plain) && (dropped(&plain.look, drop) || plain.nis > DOUBT));
        let held_back = plain.is_some_and(|plain| self.may_be_held_back(&plain) && self.is_held_back(&found, &plain));
        let taken = found.look.leak < LEAK && dropped(&found.look, drop) && (also || held_back);
        taken.then_some(Finding { occluded: true, reason: COVERED, ..found })
    }

    /// Something known begins to cover a large target, and its edge stands for the target's own: what is on
    /// the side towards which the target is off has no vote.
    fn begun(&self, frame: &Frame<f64>, plain: &Finding) -> Option<Finding> {
        let (at, expected) = (self.position(&plain.aligned.pose), self.filter.position());
        let side = Silence::Towards([expected[0] - at[0], expected[1] - at[1]]);
        let how = (Freedom::Translation, side, PRIOR, &LEVELS[1..]);
        let found = self.try_at(frame, &self.expected(false), how)?;
        let taken = found.look.leak < LEAK && self.is_held_back(&found, plain);
        taken.then_some(Finding { occluded: true, reason: COVERED, ..found })
    }

    /// Whether what is not seen of it may be covered. While the support is still adapting to the box that is
    /// not told, but of a large target that was seen whole: of a small one a wrong box leaves as much unseen
    /// as cover.
    fn is_known(&self) -> bool {
        self.age >= YOUNG && !self.is_adapting() || self.most_seen > WHOLE && self.is_large()
    }

    /// Whether the support is still adapting to what the box holds: a target of which much was never seen had
    /// a box with much else in it.
    pub(super) fn is_adapting(&self) -> bool {
        self.age < self.adapts_until
    }

    /// Whether a strip along a side is little of the target.
    fn is_large(&self) -> bool {
        STRIP / self.side() < DROP
    }

    /// Whether a large target is not where it is expected. The filter takes turns for granted, and is no
    /// judge of fractions of a pixel.
    fn may_be_held_back(&self, plain: &Finding) -> bool {
        self.is_large() && self.off(plain) > HELD_BACK
    }

    /// Whether a large target is rather `elsewhere`, nearer to where it is expected, than where it would be
    /// if all of it were seen, `plain`. The edge of what begins to cover a plain target stands for its own,
    /// and holds it back or makes it shrink at the price of another: the area that is not explained stays the
    /// same. A target that has really turned leaves two strips that are not, one on either side of the
    /// expected place, as long as the target is wide and as wide as it is off.
    fn is_held_back(&self, elsewhere: &Finding, plain: &Finding) -> bool {
        let [at, held] = [elsewhere, plain].map(|finding| self.position(&finding.aligned.pose));
        let apart = (at[0] - held[0]).hypot(at[1] - held[1]);
        let strip = apart * self.side() / plain.aligned.pose.scale().max(0.1);
        apart > HELD_BACK && elsewhere.nis < DOUBT && elsewhere.look.mismatch < plain.look.mismatch + strip
    }

    /// Shorter side, px of the target.
    pub(super) fn side(&self) -> f64 {
        let [width, height] = self.target.extent();
        width.min(height).max(1.0)
    }

    /// Distance from where the target is expected, px.
    fn off(&self, found: &Finding) -> f64 {
        let (at, expected) = (self.position(&found.aligned.pose), self.filter.position());
        (at[0] - expected[0]).hypot(at[1] - expected[1])
    }

    /// Whether something that looks like the target touches it: much of it beside the target, on one side. A
    /// moment after that was so, what pulls the target out of its way or makes it grow is still the
    /// look-alike. That ends by itself: size and way of the target are not followed meanwhile, and would
    /// differ the more the longer it lasts.
    fn is_touched(&self, found: &Finding) -> Option<&'static str> {
        if found.look.leak > TOUCH.0 && found.look.one_sided > TOUCH.1 {
            return Some(TOUCHED);
        }
        let grown = (found.aligned.pose.scale() / self.pose.scale() - 1.0).abs() > GROWN;
        (self.wary > 0 && (found.nis > SURE || grown)).then_some(TOUCHED_BEFORE)
    }

    /// Something that looks like the target touches it.
    fn touched(&self, frame: &Frame<f64>, levels: &[f64], reason: &'static str) -> Option<Finding> {
        let how = (self.freedom, Silence::Lookalike, [self.spread(), STIFF], levels);
        let found = self.try_at(frame, &self.expected(false), how)?;
        Some(Finding { occluded: true, reason, ..found })
    }

    /// All around, in whole pixels, and then as usual.
    fn searched(&self, frame: &Frame<f64>) -> Option<Finding> {
        let reach = (REACH.0 + self.missed).min(REACH.1);
        let guess = self.expected(false);
        let place = search::search(frame, &self.target, &self.background, (&guess, 1.0), reach)?;
        let how = (Freedom::Translation, Silence::None, PRIOR, &LEVELS[1..]);
        let found = self.try_at(frame, &place, how)?;
        (found.look.visibility >= WELL).then_some(Finding { reason: SEARCHED, ..found })
    }

    /// Deviation of the expected position, px.
    fn spread(&self) -> f64 {
        (0.5 * (self.filter.p[0][(0, 0)] + self.filter.p[1][(0, 0)])).sqrt().clamp(0.2, 3.0)
    }
}
