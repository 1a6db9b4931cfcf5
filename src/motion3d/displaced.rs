//! Which rotation is taken out of displacements, and when that is worth its while.
//!
//! Half way between both ends a displacement is the instantaneous flow to second order. The rest, of third order in rotation and translation, is in no covariance; rows that have the motion's own rotation taken out of them ([`turned`](super::turned)) have none. Where the rest would move
//! an estimate by a small share of its deviation, nothing is turned.

use super::grid::at_most;
use super::intake::Intake;
use super::kernels::depths;
use super::likelihood::different;
use super::motion::Motion;
use super::observations::{Observations, quantile};
use super::refine::{Effort, Minimum, refine};
use crate::math::random::CounterRng;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// Points whose rest is looked at, and those from which a first rotation is found.
const SAMPLED: usize = 256;
const FIRST: usize = 400;

/// Sum of squared changes of the residuals, in squared units of noise, that is negligible: no unknown would come out otherwise by more than its root in deviations.
pub(super) const NEGLIGIBLE: f64 = 0.0025;

/// The same once rows are turned anyway, and the change of the rotation, rad, that is rounding.
const SETTLED: f64 = 1e-10;
const ROUNDING: f64 = 1e-13;

/// Most times that rows are turned about what they gave.
const ROUNDS: usize = 6;

/// Pairs of points that a first rotation is tried from, the share of the points that decide between them, and rounds of weights.
const PAIRS: usize = 64;
const SHARE: f64 = 0.3;
const STEPS: usize = 10;
/// The cut of Tukey's weights in units of the deciding residual.
const CUT: f64 = 3.0;
/// Times that the first rotation is taken out and found again.
const TURNS: usize = 3;

/// Sum over all points of the squared changes of the residuals of `motion` if the points were turned about its rotation, in squared units of noise.
///
/// By Cauchy's inequality the estimate would change by no more than the root of that, in its deviations.
pub(super) fn rest(intake: &Intake<'_>, points: &Observations, motion: &Motion) -> f64 {
    if !points.displaced {
        return 0.0;
    }
    let few = &*at_most(points, SAMPLED, CounterRng::new(0));
    let (here, exact) = (depths(few, motion), depths(&intake.turned(few, &motion.w()), motion));
    let sum: f64 = here.e.iter().zip(&exact.e).map(|(a, b)| (a - b) * (a - b)).sum();
    sum * points.n as f64 / few.n.max(1) as f64
}

/// The points with a rotation taken out that explains most of the flow by itself; `None` where that changes less than `negligible`, in squared units of noise, or where there is none.
///
/// What is left of the flow is short, and so is the rest of third order: even a search that knows nothing of the motion then sees exact flow, nearly.
pub(super) fn beforehand(
    intake: &Intake<'_>,
    points: &Observations,
    negligible: f64,
    rng: CounterRng,
) -> Option<Observations> {
    if !points.displaced {
        return None;
    }
    let few = &*at_most(points, FIRST, rng.stream(0));
    let mut w = reweighted(few, likeliest(few, rng.stream(1))?)?;
    let mut turned = intake.turned(few, &w);
    for _ in 0..TURNS {
        w = reweighted(&turned, w)?;
        turned = intake.turned(few, &w);
    }
    let changed = |k: usize| {
        let (before, after) = (few.row(k), turned.row(k));
        ((before.f - before.r * w) - (after.f - after.r * w)).norm_squared()
    };
    let rest = (0..few.n).map(changed).sum::<f64>() * points.n as f64 / few.n as f64;
    (rest > negligible).then(|| intake.turned(points, &w))
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
    let mut negligible = NEGLIGIBLE;
    for _ in 0..ROUNDS {
        let w = lead.motion.w();
        let noise = if unknown { lead.equations.cost / inliers.n.saturating_sub(5).max(1) as f64 } else { 1.0 };
        let same = inliers.turn.is_some_and(|turn| (turn.rotation - w).norm() < ROUNDING);
        if same || rest(intake, inliers, &lead.motion) <= negligible * noise {
            break;
        }
        *inliers = intake.turned(inliers, &w);
        lead = refine(inliers, lead.motion, None, Effort::FULL);
        negligible = SETTLED;
    }
    if let Some(turn) = inliers.turn.filter(|_| negligible < NEGLIGIBLE) {
        *all = intake.turned(all, &turn.rotation);
        let again = |minimum: &Minimum| refine(inliers, minimum.motion, None, Effort::FULL);
        *found = different(found.par_iter().map(again).chain([lead]).collect());
    }
}

/// The rotation of two points that most points come near to.
fn likeliest(points: &Observations, rng: CounterRng) -> Option<Vector3<f64>> {
    let draw = |place: u64| ((rng.uniform(place) * points.n as f64) as usize).min(points.n - 1);
    let pair = |i: u64| least_squares(points, &[draw(2 * i), draw(2 * i + 1)].map(|k| (k, 1.0)));
    let all: Vec<(usize, f64)> = (0..points.n).map(|k| (k, 1.0)).collect();
    let tried = (0..PAIRS as u64).filter_map(pair).chain(least_squares(points, &all));
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

/// A rotation by weighted least squares.
fn least_squares(points: &Observations, weights: &[(usize, f64)]) -> Option<Vector3<f64>> {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for &(k, weight) in weights {
        let row = points.row(k);
        normal += row.r.transpose() * row.r * weight;
        right += row.r.transpose() * row.f * weight;
    }
    let w = normal.cholesky()?.solve(&right);
    w.iter().all(|value| value.is_finite()).then_some(w)
}

/// The same with Tukey's weights about `start`.
fn reweighted(points: &Observations, start: Vector3<f64>) -> Option<Vector3<f64>> {
    let mut w = start;
    for _ in 0..STEPS {
        let cut = CUT * CUT * deciding(points, &w).max(f64::MIN_POSITIVE);
        let weight = |k: usize| (k, (1.0 - left(points, k, &w) / cut).max(0.0).powi(2));
        let weights: Vec<(usize, f64)> = (0..points.n).map(weight).collect();
        // Where hardly a point counts the last rotation was better.
        let Some(next) = least_squares(points, &weights) else { break };
        let settled = (next - w).norm() < ROUNDING;
        w = next;
        if settled {
            break;
        }
    }
    Some(w)
}
