//! Which rotation is taken out of displacements, and when that is worth its while.
//!
//! Half way between both ends a displacement is the instantaneous flow to second order. The rest, of third order in rotation and translation, is in no covariance; rows that have the motion's own rotation taken out of them ([`turned`](super::turned)) have none. Where the rest would move
//! an estimate by a small share of its deviation, nothing is turned.

use super::grid::at_most;
use super::intake::Intake;
use super::kernels::depths;
use super::likelihood::different;
use super::motion::{Motion, tangents};
use super::observations::{Observations, quantile};
use super::refine::{Effort, Minimum, refine};
use super::together::slopes;
use crate::math::random::CounterRng;
use nalgebra::{Matrix3, SMatrix, Vector3};
use rayon::prelude::*;
use std::borrow::Cow;

/// Points whose rest is looked at, and those from which a first rotation is found.
const SAMPLED: usize = 256;
const FIRST: usize = 200;

/// Squared shift of an estimate, in its deviations, that is negligible.
const NEGLIGIBLE: f64 = 0.01;

/// The same once rows are turned anyway: of [`MANY`] points another round costs more than it tells; and the change of the rotation, rad, that is rounding.
const SETTLED: f64 = 1e-14;
const ROUGHLY: f64 = 1e-4;
const MANY: usize = 10_000;
const ROUNDING: f64 = 1e-13;

/// What a rest may add to squared residuals, in deviations of their sum by chance, before anything is known of the motion.
const HIDDEN: f64 = 0.1;

/// Root mean square of the rest, in units of noise, that decides of hardly a point whether it obeys.
const OBEYING: f64 = 0.1;

/// Most times that rows are turned about what they gave.
const ROUNDS: usize = 6;

/// Pairs of points that a first rotation is tried from, the share of the points that decide between them, and rounds of weights.
const PAIRS: usize = 32;
const SHARE: f64 = 0.3;
const STEPS: usize = 6;
/// The cut of Tukey's weights in units of the deciding residual.
const CUT: f64 = 3.0;
/// Times that the first rotation is taken out and found again.
const TURNS: usize = 3;

/// By how much the residuals of `motion` would change if the points were turned about its rotation, at a sample of them.
fn changes<'a>(intake: &Intake<'_>, points: &'a Observations, motion: &Motion) -> (Cow<'a, Observations>, Vec<f64>) {
    let few = at_most(points, SAMPLED, CounterRng::new(0));
    let (here, exact) = (depths(&few, motion), depths(&intake.turned(&few, &motion.w()), motion));
    let changes = here.e.iter().zip(&exact.e).map(|(here, exact)| exact - here).take(few.n).collect();
    (few, changes)
}

/// The square of what an estimate would come out otherwise by, in its deviations, if the points were turned about its rotation: `g^t H^-1 g` of the changes' `g = sum D^t de`.
pub(super) fn shift(intake: &Intake<'_>, points: &Observations, motion: &Motion) -> f64 {
    if !points.displaced {
        return 0.0;
    }
    let (few, changes) = changes(intake, points, motion);
    let tangent = tangents(&motion.u());
    let nu = depths(&few, motion).nu;
    let (mut h, mut g) = (SMatrix::<f64, 5, 5>::zeros(), SMatrix::<f64, 5, 1>::zeros());
    for (k, change) in changes.iter().enumerate() {
        let row = slopes(&few, motion, &tangent, nu[k], k);
        h += row * row.transpose();
        g += row * *change;
    }
    let share = points.n as f64 / few.n.max(1) as f64;
    // Without a solution the sum of squares is more.
    let most: f64 = changes.iter().map(|change| change * change).sum();
    share * h.cholesky().map_or(most, |factor| g.dot(&factor.solve(&g)).min(most))
}

/// Whether turning the points about the rotation of `motion` would move its estimate.
pub(super) fn matters(intake: &Intake<'_>, points: &Observations, motion: &Motion) -> bool {
    shift(intake, points, motion) > NEGLIGIBLE
}

/// Whether it would decide otherwise of points that obey.
pub(super) fn decides(intake: &Intake<'_>, points: &Observations, motion: &Motion) -> bool {
    if !points.displaced {
        return false;
    }
    let (_, changes) = changes(intake, points, motion);
    changes.iter().map(|change| change * change).sum::<f64>() > OBEYING * OBEYING * changes.len() as f64
}

/// The points with a rotation taken out that explains most of the flow by itself, of all points or (`robust`) of many; `None` where that hides in the noise, or where there is none.
///
/// What is left of the flow is short, and so is the rest of third order: even a search that knows nothing of the motion then sees exact flow, nearly. Of noise that is `unknown` anything may be more.
pub(super) fn beforehand(
    intake: &Intake<'_>,
    points: &Observations,
    (robust, unknown): (bool, bool),
    rng: CounterRng,
) -> Option<Observations> {
    if !points.displaced {
        return None;
    }
    let few = &*at_most(points, FIRST, rng.stream(0));
    let again =
        |points: &Observations, w| if robust { Some(reweighted(points, w)) } else { least_squares(points, |_| 1.0) };
    let mut w = again(few, if robust { likeliest(few, rng.stream(1))? } else { Vector3::zeros() })?;
    let mut turned = intake.turned(few, &w);
    let hidden = if unknown { 0.0 } else { HIDDEN * 2.0 * (points.n as f64).sqrt() };
    if rest(few, &turned, &w) * points.n as f64 <= hidden {
        return None;
    }
    for _ in 0..TURNS {
        w = again(&turned, w)?;
        turned = intake.turned(few, &w);
    }
    Some(intake.turned(points, &w))
}

/// The mean square of what turning changes in the flow that a rotation leaves.
fn rest(points: &Observations, turned: &Observations, w: &Vector3<f64>) -> f64 {
    let changed = |k: usize| {
        let (before, after) = (points.row(k), turned.row(k));
        ((before.f - before.r * w) - (after.f - after.r * w)).norm_squared()
    };
    (0..points.n).map(changed).sum::<f64>() / points.n as f64
}

/// Turns the inliers about the rotation of `lead`, the minimum that matters, until that stays; then all points, and refines `found`. `unknown`: the noise is what the lead leaves.
pub(super) fn settle(
    intake: &Intake<'_>,
    all: &mut Observations,
    inliers: &mut Observations,
    found: &mut Vec<Minimum>,
    mut lead: Minimum,
    unknown: bool,
) {
    let settled = if inliers.n < MANY { SETTLED } else { ROUGHLY };
    let mut negligible = if inliers.turn.is_some() { settled } else { NEGLIGIBLE };
    let (began, mut turned) = (lead.motion, false);
    for _ in 0..ROUNDS {
        let w = lead.motion.w();
        let noise = if unknown { lead.equations.cost / inliers.n.saturating_sub(5).max(1) as f64 } else { 1.0 };
        let same = inliers.turn.is_some_and(|turn| (turn.rotation - w).norm() < ROUNDING);
        if same || shift(intake, inliers, &lead.motion) <= negligible * noise {
            break;
        }
        *inliers = intake.turned(inliers, &w);
        lead = refine(inliers, lead.motion, None, Effort::FULL);
        (negligible, turned) = (settled, true);
    }
    if let Some(turn) = inliers.turn.filter(|_| turned) {
        *all = if all.n == inliers.n { inliers.clone() } else { intake.turned(all, &turn.rotation) };
        let other = |minimum: &&Minimum| minimum.motion != began;
        let again = |minimum: &Minimum| refine(inliers, minimum.motion, None, Effort::ROUGH);
        *found = different(found.par_iter().filter(other).map(again).chain([lead]).collect());
    }
}

/// The rotation of two points that most points come near to.
fn likeliest(points: &Observations, rng: CounterRng) -> Option<Vector3<f64>> {
    let draw = |place: u64| ((rng.uniform(place) * points.n as f64) as usize).min(points.n - 1);
    let pair = |i: u64| least_squares(&points.subset(&[draw(2 * i), draw(2 * i + 1)].map(|k| k as u32)), |_| 1.0);
    let tried = (0..PAIRS as u64).filter_map(pair).chain(least_squares(points, |_| 1.0));
    let cost = |w: Vector3<f64>| (deciding(points, &w), w);
    tried.map(cost).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, w)| w)
}

/// The squared residual that decides between rotations: that of a point at the end of the nearest [`SHARE`].
fn deciding(points: &Observations, w: &Vector3<f64>) -> f64 {
    let mut squares: Vec<f64> = (0..points.n).map(|k| left(points, k, w)).collect();
    quantile(&mut squares, SHARE)
}

fn left(points: &Observations, k: usize, w: &Vector3<f64>) -> f64 {
    let row = points.row(k);
    (row.f - row.r * w).norm_squared()
}

/// A rotation by least squares with a weight for each point.
fn least_squares(points: &Observations, weight: impl Fn(usize) -> f64) -> Option<Vector3<f64>> {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for k in 0..points.n {
        let (row, weight) = (points.row(k), weight(k));
        normal += row.r.transpose() * row.r * weight;
        right += row.r.transpose() * row.f * weight;
    }
    let w = normal.cholesky()?.solve(&right);
    w.iter().all(|value| value.is_finite()).then_some(w)
}

/// The same with Tukey's weights about `start`.
fn reweighted(points: &Observations, start: Vector3<f64>) -> Vector3<f64> {
    let mut w = start;
    for _ in 0..STEPS {
        let cut = CUT * CUT * deciding(points, &w).max(f64::MIN_POSITIVE);
        // Where hardly a point counts the last rotation was better.
        let Some(next) = least_squares(points, |k| (1.0 - left(points, k, &w) / cut).max(0.0).powi(2)) else { break };
        let settled = (next - w).norm() < ROUNDING;
        w = next;
        if settled {
            break;
        }
    }
    w
}
