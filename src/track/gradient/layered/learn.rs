//! What is learned from a frame in which the target was seen well.

use super::layers::{Background, PRIOR, Target};
use super::oriented_box::OrientedBox;
use super::patch::{dilated, smooth_known};
use super::score::View;
use super::state::MIN_NOISE;
use crate::simd::{Kernel, Lanes, Level, dispatch};
use crate::track::gradient::noise::noise_of;
use crate::types::Frame;

/// Memory of the support.
const FORGETTING: f64 = 0.95;
/// Rate of the template.
const TEMPLATE_RATE: f64 = 0.08;
/// Rate of the background.
const BACKGROUND_RATE: f64 = 0.3;
/// Longest step of the background where it changes suddenly, grey levels.
const SUDDEN_STEP: f64 = 1.5;
/// Support from which on the template is learned; outside it goes on as it is there.
pub(super) const SOLID: f64 = 0.9;
/// Width of that continuation, px of the target.
pub(super) const CONTINUED: f64 = 2.0;
/// How much of the noise's last measurement is taken.
const NOISE_RATE: f64 = 0.1;
/// Pixels that the noise is measured on, at most.
const SAMPLES: usize = 4096;

pub(super) fn learn_target(target: &mut Target, view: &View, gain: f64, noise: f64) {
    learn_fresh(target, view, gain, noise);
    for at in 0..view.seen.len() {
        let (seen, behind) = (view.seen[at], view.behind[at]);
        let (bright, a) = (gain * target.t.data()[at], target.a.data()[at]);
        if seen.is_nan() {
            continue;
        }
        learn_support(target, at, (seen, behind, bright), noise);
        let model = if behind.is_nan() { bright } else { a * bright + (1.0 - a) * behind };
        let off = seen - model;
        let step = TEMPLATE_RATE * a * off / (1.0 + (off / (6.0 * noise + 10.0)).powi(2));
        target.t.data_mut()[at] = (target.t.data()[at] + step / gain.max(0.1)) * gain;
    }
    if crate::ablation::keeps("gradient.continue_template") {
        continue_template(target);
    }
}

/// Brightness of points hidden at first: the mean of what is seen of them, until they are known as well.
fn learn_fresh(target: &mut Target, view: &View, gain: f64, noise: f64) {
    let Some(mut fresh) = target.fresh.take() else { return };
    let least = 4.0 * noise + 6.0;
    let (width, height) = fresh.size();
    let covered = Frame::from_fn(width, height, |i, j| {
        let at = j * width + i;
        let behind = (view.seen[at] - view.guess[at]).abs();
        let alike = view.behind[at].is_nan() || behind < least;
        view.seen[at].is_nan() || alike && behind < (view.seen[at] - gain * target.t.get(i, j)).abs()
    });
    let covered = dilated(&covered, 1);
    for at in 0..width * height {
        let rate = fresh.data()[at];
        if rate > TEMPLATE_RATE && !covered.data()[at] {
            target.t.data_mut()[at] += rate * (view.seen[at] / gain.max(0.1) - target.t.data()[at]);
            fresh.data_mut()[at] = rate / (1.0 + rate);
        }
    }
    let unknown = fresh.data().iter().any(|rate| *rate > TEMPLATE_RATE);
    target.fresh = unknown.then_some(fresh);
}

/// `a` that explains the frames so far in the sense of least squares, beginning with the box.
fn learn_support(target: &mut Target, at: usize, (seen, behind, bright): (f64, f64, f64), noise: f64) {
    // What neither layer explains says nothing of where one ends and the other begins.
    let least = 4.0 * noise + 6.0;
    let between = (seen - bright) * (seen - behind) <= 0.0;
    let explained = between || (seen - bright).abs() < least || (seen - behind).abs() < least;
    if behind.is_nan() || !explained && crate::ablation::keeps("gradient.explained") {
        return;
    }
    let contrast = bright - behind;
    let prior = (1.0 - FORGETTING) * PRIOR;
    let n = FORGETTING * target.n.data()[at] + contrast * (seen - behind) + prior * target.prior.data()[at];
    let d = FORGETTING * target.d.data()[at] + contrast * contrast + prior;
    (target.n.data_mut()[at], target.d.data_mut()[at]) = (n, d);
    target.a.data_mut()[at] = (n / d).clamp(0.0, 1.0);
}

fn continue_template(target: &mut Target) {
    let (width, height) = target.t.size();
    let known =
        Frame::from_fn(width, height, |i, j| if target.a.get(i, j) > SOLID { target.t.get(i, j) } else { f64::NAN });
    let smooth = smooth_known(&known, CONTINUED);
    for at in 0..width * height {
        let value = smooth.data()[at];
        if known.data()[at].is_nan() && value.is_finite() {
            target.t.data_mut()[at] = value;
        }
    }
}

pub(super) fn learn_background(background: &mut Background, frame: &Frame<f64>, hidden: &OrientedBox, noise: f64) {
    let sudden = 6.0 * noise + 8.0;
    let (width, height) = frame.size();
    for y in 0..height {
        let [first, end] = hidden.columns(y, width);
        let parts = if first < end { [0..first, end..width] } else { [0..width, width..width] };
        for part in parts {
            let seen = &frame.row(y)[part.clone()];
            let known = &mut background.known.row_mut(y)[part.clone()];
            let picture = &mut background.picture.row_mut(y)[part];
            dispatch(Level::detect(), Behind { picture, seen, known, sudden });
            known.fill(true);
        }
    }
}

struct Behind<'a> {
    picture: &'a mut [f64],
    seen: &'a [f64],
    known: &'a [bool],
    sudden: f64,
}

impl Kernel<f64> for Behind<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) {
        let all_known = self.known.iter().fold(true, |all, known| all & known);
        if !all_known {
            let unknown = self.picture.iter_mut().zip(self.seen).zip(self.known).filter(|(_, known)| !**known);
            unknown.for_each(|((b, e), _)| *b = *e);
        }
        let sudden_rule = crate::ablation::keeps("gradient.sudden_background");
        for (b, e) in self.picture.iter_mut().zip(self.seen) {
            let off = e - *b;
            let step = BACKGROUND_RATE * off;
            let careful = if sudden_rule { step.clamp(-SUDDEN_STEP, SUDDEN_STEP) } else { step };
            *b += if off.abs() > self.sudden { careful } else { step };
        }
    }
}

/// Noise of the frames from the change of the still scene, grey levels; `noise`: the previous estimate.
pub(super) fn learn_noise(noise: Option<f64>, previous: &Frame<f64>, frame: &Frame<f64>) -> f64 {
    let now = noise_of(previous, frame, SAMPLES);
    noise.map_or(now, |noise| noise + NOISE_RATE * (now - noise)).max(MIN_NOISE)
}
