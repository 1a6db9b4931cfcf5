//! Which rotation is taken out of displacements, and when that matters.
//!
//! Half way between both ends a displacement is the instantaneous flow to second order. The rest, of third
//! order in rotation and translation, is in no covariance; rows that have the motion's own rotation taken out
//! of them ([`derotation`](crate::motion3d::model::rows)) have none. Where the rest would move an
//! estimate by a small share of its standard deviation, nothing is turned.

use super::likelihood::different;
use super::refine::{Minimum, StoppingCriteria, refine};
use super::starts::at_most;
use crate::math::quantile;
use crate::math::random::CounterRng;
use crate::motion3d::kernels::{depths, slopes};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::rows::{Derotation, Matrix5, Vector5, tangents};
use crate::motion3d::model::whitening::Whitening;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use std::borrow::Cow;

/// Points whose rest is looked at, and those from which a first rotation is found.
const SAMPLED: usize = 256;
const FIRST: usize = 200;

/// Squared shift of an estimate, in its standard deviations, that is negligible.
const NEGLIGIBLE: f64 = 0.01;

/// The same once rows are turned anyway: of [`MANY`] points another round costs more than it gains; and the
/// change of the rotation, rad, that is rounding.
const SETTLED: f64 = 1e-14;
const ROUGHLY: f64 = 1e-3;
const MANY: usize = 10_000;
pub(crate) const ROUNDING: f64 = 1e-13;

/// What a rest may add to squared residuals, in standard deviations of their sum by chance, before anything
/// is known of the motion.
const HIDDEN: f64 = 0.1;

/// Root mean square of the rest, in units of noise, that changes few inliers.
const MAX_REST: f64 = 0.1;

/// Most times that rows are turned about what they gave.
pub(crate) const ROUNDS: usize = 6;

/// Pairs of points that a first rotation is tried from, the share of the points that decide between them, and
/// rounds of weights.
const PAIRS: usize = 32;
const SHARE: f64 = 0.3;
const STEPS: usize = 6;
/// The cut of Tukey's weights in units of the deciding residual.
const CUT: f64 = 3.0;
/// Times that the first rotation is taken out and found again.
const TURNS: usize = 3;

/// By how much the residuals of `motion` would change if the points were turned about its rotation, at a
/// sample of them.
fn changes<'a>(
    whitening: &Whitening<'_>,
    points: &'a Observations,
    motion: &Motion,
) -> (Cow<'a, Observations>, Vec<f64>) {
    let few = at_most(points, SAMPLED, CounterRng::new(0));
    let (here, turned) = (depths(&few, motion), whitening.derotated(&few, motion.derotation()));
    let changes = if few.turn.is_some() {
        let there = depths(&turned, motion);
        there.e.iter().zip(&here.e).map(|(there, here)| there - here).take(few.n).collect()
    } else {
        (0..few.n).map(|k| half_way_residual(&turned, motion, k) - here.e[k]).collect()
    };
    (few, changes)
}

/// The residual of a turned point with the row of the translation half way, as those that are not turned have
/// it: `G(m) t = G(eta_1') t - (eta_2' - eta_1') t_z / 2`.
fn half_way_residual(turned: &Observations, motion: &Motion, k: usize) -> f64 {
    let Some(turn) = &turned.turn else { return 0.0 };
    let row = turned.row(k);
    let (t, left) = (row.g * motion.u(), row.f - row.r * motion.w());
    let middle = t - left * (0.5 * (turn.mean * motion.u()).z);
    let s2 = middle.norm_squared();
    if s2 > turned.floor { (t.y * left.x - t.x * left.y) / s2.sqrt() } else { 0.0 }
}

/// The squared shift of an estimate, in its standard deviations, if the points were derotated about its
/// rotation: `g^t H^-1 g` of the changes' `g = sum D^t de`.
pub(crate) fn shift(whitening: &Whitening<'_>, points: &Observations, motion: &Motion) -> f64 {
    if !points.displaced {
        return 0.0;
    }
    let (few, changes) = changes(whitening, points, motion);
    let tangent = tangents(&motion.u());
    let nu = depths(&few, motion).nu;
    let (mut h, mut g) = (Matrix5::zeros(), Vector5::zeros());
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
pub(crate) fn matters(whitening: &Whitening<'_>, points: &Observations, motion: &Motion) -> bool {
    shift(whitening, points, motion) > NEGLIGIBLE
}

/// Whether it would change which points are inliers.
pub(crate) fn decides(whitening: &Whitening<'_>, points: &Observations, motion: &Motion) -> bool {
    if !points.displaced {
        return false;
    }
    let (_, changes) = changes(whitening, points, motion);
    changes.iter().map(|change| change * change).sum::<f64>() > MAX_REST * MAX_REST * changes.len() as f64
}

/// The points with a rotation taken out that explains most of the flow by itself, of all points or (`robust`)
/// of many; `None` where that hides in the noise, or where there is none.
///
/// What is left of the flow is short, and so is the rest of third order: even a search that knows nothing of
/// the motion then sees exact flow, nearly. Of noise that is `unknown` anything may be more.
pub(crate) fn beforehand(
    whitening: &Whitening<'_>,
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
    let mut turned = whitening.derotated(few, Derotation::new(&w));
    let hidden = if unknown { 0.0 } else { HIDDEN * 2.0 * (points.n as f64).sqrt() };
    if rest(few, &turned, &w) * points.n as f64 <= hidden {
        return None;
    }
    for _ in 0..TURNS {
        w = again(&turned, w)?;
        turned = whitening.derotated(few, Derotation::new(&w));
    }
    Some(whitening.derotated(points, Derotation::new(&w)))
}

/// The points with the rotation taken out that explains most of their flow by itself, regardless of what was
/// taken out before; `None` where there is none.
pub(crate) fn afresh(whitening: &Whitening<'_>, points: &Observations) -> Option<Observations> {
    let mut turned = whitening.derotated(points, Derotation::new(&Vector3::zeros()));
    for _ in 0..=TURNS {
        let w = least_squares(&turned, |_| 1.0)?;
        turned = whitening.derotated(points, Derotation::new(&w));
    }
    Some(turned)
}

/// The mean square of what turning changes in the flow that a rotation leaves.
fn rest(points: &Observations, turned: &Observations, w: &Vector3<f64>) -> f64 {
    let changed = |k: usize| {
        let (before, after) = (points.row(k), turned.row(k));
        ((before.f - before.r * w) - (after.f - after.r * w)).norm_squared()
    };
    (0..points.n).map(changed).sum::<f64>() / points.n as f64
}

/// Takes the rotation of `lead`, the minimum that matters, out of the inliers until it stays; then out of all
/// points, and refines `found`. `unknown`: the noise is what the lead leaves.
pub(crate) fn settle(
    whitening: &Whitening<'_>,
    all: &mut Observations,
    inliers: &mut Observations,
    found: &mut Vec<Minimum>,
    lead: &Minimum,
    unknown: bool,
) {
    let (own, Some(turned)) = follow(whitening, inliers, *lead, unknown) else { return };
    let others: Vec<Minimum> = found.iter().filter(|other| other.motion != lead.motion).copied().collect();
    let again = |minimum: &Minimum| refine(&turned, minimum.motion, None, StoppingCriteria::ROUGH);
    let again = different(others.par_iter().map(again).chain([own]).collect());
    // Without a rotation that can be taken out the linear model's minima stay.
    if again.is_empty() {
        return;
    }
    (*found, *inliers) = (again, turned);
    if let Some(turn) = inliers.turn {
        *all = if all.n == inliers.n { inliers.clone() } else { whitening.derotated(all, turn) };
    }
}

/// Takes the rotation of a minimum out of the points until it stays; without points where that makes no
/// difference.
fn follow(
    whitening: &Whitening<'_>,
    points: &Observations,
    mut minimum: Minimum,
    unknown: bool,
) -> (Minimum, Option<Observations>) {
    let settled = if points.n < MANY { SETTLED } else { ROUGHLY };
    let mut negligible = if points.turn.is_some() { settled } else { NEGLIGIBLE };
    let mut turned: Option<Observations> = None;
    for _ in 0..ROUNDS {
        let here = turned.as_ref().unwrap_or(points);
        let w = minimum.motion.w();
        let same = here.turn.is_some_and(|turn| (turn.rotation - w).norm() < ROUNDING);
        // The noise's variance in present units.
        let noise = if unknown { minimum.equations.cost / points.n.saturating_sub(5).max(1) as f64 } else { 1.0 };
        if same || shift(whitening, here, &minimum.motion) <= negligible * noise {
            break;
        }
        let next = whitening.derotated(here, minimum.motion.derotation());
        minimum = refine(&next, minimum.motion, None, StoppingCriteria::of(next.n));
        turned = Some(next);
        negligible = settled;
    }
    (minimum, turned)
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
    quantile(&mut squares, SHARE).unwrap_or(0.0)
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
        // Where few points count the last rotation was better.
        let Some(next) = least_squares(points, |k| (1.0 - left(points, k, &w) / cut).max(0.0).powi(2)) else { break };
        let settled = (next - w).norm() < ROUNDING;
        w = next;
        if settled {
            break;
        }
    }
    w
}
