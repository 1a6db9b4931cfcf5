//! What a measurement changes of all that is known of the target, and what a frame without one does.

use super::find::{COVERED, DROP, Finding, LEAST, SEARCHED, TOUCHED, WELL, YOUNG};
use super::look::view;
use super::pose::Pose;
use super::sound::DAMPED;
use super::{Layered, begun, learn, resized};
use crate::track::gradient::gauss_markov::Measurement;
use crate::types::Frame;

/// Innovation squared of a target found by looking all around from which on its velocity says nothing.
const JUMPED: f64 = 100.0;
/// Frames after a look-alike touched for which it is reckoned with.
const WARY: usize = 8;
/// Least information about the rotation, of all there could be, from which on it is told; else the angle is
/// held. Round targets are known by their outline: this bounds what errors of that may turn.
const TOLD: f64 = 0.75;
/// Least deviation of a measured position, px.
const LEAST_DEVIATION: f64 = 0.05;
/// Frames after an interruption in which what is not seen of the target may be hidden still.
const RETURNING: usize = 3;
/// How far a target must have gone while it is young, over its shorter side, for what its box holds besides
/// to have stayed behind; slower ones wait for that in vain.
const FAR: f64 = 0.4;
/// Rate of the filtered change of size and angle.
const RATE: f64 = 0.3;
/// The same of the mean visibility.
const VISIBILITY_RATE: f64 = 0.1;

impl Layered {
    /// A measurement.
    pub(super) fn take(&mut self, found: &Finding, frame: &Frame<f64>) {
        let Finding { aligned, look, occluded, .. } = *found;
        let interrupted = self.missed > 0 || self.hidden || occluded;
        let mut pose = aligned.pose;
        if let Some(told) = aligned.rotation_told {
            self.rotation_told = told >= TOLD || occluded && self.rotation_told;
        }
        let at = self.position(&pose);
        if !self.rotation_told && !occluded {
            pose = self.placed(pose.turned_to(self.pose.angle()), at);
        }
        if !occluded {
            self.faintness = (self.noise / look.contrast.max(1.0)).min(1.0);
        }
        self.returning = if self.missed > 0 { RETURNING } else { self.returning.saturating_sub(1) };
        // Where a part of it is still hidden, all of it may be that much farther on.
        let behind = if self.returning > 0 { self.side() * (1.0 - look.visibility) } else { 0.0 };
        let visible = look.visibility.max(0.1);
        let variance: [f64; 2] = std::array::from_fn(|k| {
            let own = aligned.covariance[k][k].max(LEAST_DEVIATION.powi(2)) / (visible * visible);
            own + behind * behind + if occluded { (1.5 * (1.0 - look.visibility)).powi(2) } else { 0.0 }
        });
        let step = self.before.filter(|_| !interrupted).map(|before| [at[0] - before[0], at[1] - before[1]]);
        if (found.reason == SEARCHED || found.reason == resized::RESIZED) && found.nis > JUMPED {
            // Nobody moves like that: it is begun anew where it was found.
            self.filter = begun(at);
        }
        if occluded && !self.hidden {
            self.filter.x.iter_mut().for_each(|x| x[2] *= DAMPED);
        }
        self.filter.update(&Measurement {
            position: Some((at, variance)),
            velocity: step.map(|step| (step, variance.map(|v| 2.0 * v))),
        });
        let smaller = self.became_smaller(&pose);
        self.turn_to(&pose);
        self.remember(found, smaller);
        if interrupted {
            self.rate = [0.0; 6];
        } else {
            (2..6).for_each(|k| self.rate[k] += RATE * aligned.moved[k]);
            if !self.rotation_told {
                let growth = 0.5 * (self.rate[2] + self.rate[5]);
                self.rate = [0.0, 0.0, growth, 0.0, 0.0, growth];
            }
        }
        self.before = (!occluded).then_some(at);
        self.front = self.front.take().filter(|front| occluded && !front.is_past(&self.target, &self.pose));
        (self.missed, self.hidden) = (0, occluded);
        self.covered = if occluded { self.covered + 1 } else { 0 };
        self.wary = if found.reason == TOUCHED { WARY } else { self.wary.saturating_sub(1) };
        self.age += 1;
        self.most_seen = if occluded { self.most_seen } else { self.most_seen.max(look.visibility) };
        if found.reason == COVERED && look.visibility > self.usual - DROP {
            // What stays hidden, though it is little, is not covered but gone.
            self.usual += VISIBILITY_RATE * (look.visibility - self.usual);
        }
        let [right, down] = self.filter.speed();
        let far = right.hypot(down) * YOUNG as f64 > FAR * self.side() * self.pose.scale();
        if self.age >= YOUNG && (occluded || !far || look.visibility >= WELL) {
            self.adapts_until = 0;
        }
        let least = if self.age <= YOUNG || self.is_adapting() { LEAST[0] } else { WELL };
        if !occluded && look.visibility >= least {
            self.learn(frame, aligned.gain, look.visibility);
        } else if self.target.fresh.is_some() {
            let view = view(frame, &self.target, &self.background, &self.pose);
            learn::learn_fresh(&mut self.target, &view, aligned.gain, self.noise);
        }
        if self.front.is_some() {
            let hidden = self.hides();
            learn::learn_background(&mut self.background, frame, &hidden, self.noise);
        }
    }

    fn turn_to(&mut self, pose: &Pose) {
        let turn = pose.angle() - self.pose.angle();
        self.turned += turn.sin().atan2(turn.cos());
        self.pose = *pose;
    }

    fn learn(&mut self, frame: &Frame<f64>, gain: f64, visibility: f64) {
        let view = view(frame, &self.target, &self.background, &self.pose);
        let before = self.position(&self.pose);
        learn::learn_target(&mut self.target, &view, gain, self.noise);
        self.settle(before);
        self.gain *= gain;
        self.target.learn_margin(&view, self.gain, self.noise);
        self.usual += VISIBILITY_RATE * (visibility - self.usual);
        let hidden = self.hides();
        learn::learn_background(&mut self.background, frame, &hidden, self.noise);
    }

    /// No measurement.
    pub(super) fn miss(&mut self) {
        self.missed += 1;
        self.covered = 0;
        self.before = None;
        self.rate = [0.0; 6];
        self.pose = self.placed(self.pose, self.filter.position());
    }
}
