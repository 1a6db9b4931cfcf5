//! The status of a motion, and which directions explain the flow as well as the estimate does.

use super::{planar_twin::planar_twin, solution::Solution};
use crate::ablation::keeps;
use crate::math::{random::CounterRng, tangents};
use crate::motion3d::kernels::{Bilinear, Weighted, best_rotation, depths, equations, front_equations, information};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::result::{Alternative, Status};
use crate::motion3d::model::rows::{Matrix5, Vector5};
use crate::motion3d::model::whitening::Whitening;
use crate::motion3d::solver::covariance::{PLAUSIBLE, determined, direction_deviation};
use crate::motion3d::solver::depth_smoother;
use crate::motion3d::solver::likelihood::{DISTINCT, SAME};
use crate::motion3d::solver::refine::{MANY, StoppingCriteria, descend};
use crate::motion3d::solver::starts::{SEARCHED, at_most, evaluate};
use crate::scattered::{SiteSmoother, Smoother};
use nalgebra::{Matrix2x3, Vector2, Vector3};

/// Below so many points several motions may explain them exactly.
const FEW: usize = 12;

/// Standard deviation of the direction, degrees, beyond which it is not known.
pub(crate) const WIDE: f64 = 20.0;

/// The farthest that a direction is from one of those looked at, degrees.
const SPACING: f64 = 4.0;

/// Standard deviations that a direction must be off for its residuals alone to decide.
const FAR: f64 = 4.0;

/// Squared standard deviations by which depths behind the camera must make another motion worse for it to be
/// excluded: a chance of about 1 in 100.
pub(crate) const SURE: f64 = 9.0;

/// Finds what else could be true: the status, and the other motions among the alternatives.
///
/// `unknown`: the noise is what the motion leaves; `competing`: motions of other points.
pub(crate) fn judge(
    whitening: &Whitening<'_>,
    inliers: &Observations,
    solution: &mut Solution,
    unknown: bool,
    competing: &[Alternative],
    rng: CounterRng,
) {
    let deviation = solution.covariance.map_or(f64::INFINITY, |c| direction_deviation(&c));
    // Where even that is not finite, no other motion is distinct.
    let distinct = (DISTINCT * if deviation.is_finite() { deviation } else { 0.0 }).to_radians().max(1e-6);
    let twin = planar_twin(whitening, inliers, &solution.motion, distinct, unknown);
    let twin = twin.map(|twin| Alternative { excess: twin.excess - solution.minimum.equations.behind, ..twin });
    let twin = twin.filter(|twin| twin.excess < SURE);
    let turned = opposite(inliers, &solution.motion, rng.stream(0));
    let found = competing.iter().copied().chain(solution.undecided).chain(turned).chain(twin);
    let same = if deviation.is_finite() { deviation.max(SAME) } else { SAME };
    solution.alternatives = different(found.chain(solution.alternatives.drain(..)), same);
    let motions = [solution.motion, solution.minimum.motion];
    let here = equations(inliers, &solution.motion, &solution.tangent, None);
    solution.status = if inliers.n < FEW {
        Status::FewPoints
    } else if inliers.unseen() > 0 {
        // Rotated by so much that points are behind the camera: such a motion is not supported by all
        // of them.
        Status::IllConditioned
    } else if determined(&here.h).is_none() {
        solution.covariance = None;
        Status::IllConditioned
    } else if twin.is_some() || !competing.is_empty() {
        Status::Ambiguous
    } else if !solution.described
        || deviation.is_nan()
        || deviation > WIDE
        || far(inliers, &motions, deviation, rng.stream(1))
    {
        Status::IllConditioned
    } else if turned.is_some() || solution.undecided.is_some() {
        Status::Ambiguous
    } else if solution.plugged.is_none() {
        Status::LowSnr
    } else {
        Status::Ok
    };
    if solution.status == Status::IllConditioned
        && let Some(covariance) = &mut solution.covariance
    {
        *covariance += between(&solution.motion, &solution.tangent, &solution.alternatives);
    }
}

/// What the alternatives add to a covariance by the law of total variance, with the probabilities that their
/// likelihoods give them.
fn between(motion: &Motion, tangent: &Matrix2x3<f64>, alternatives: &[Alternative]) -> Matrix5 {
    let weights: Vec<f64> = alternatives.iter().map(|other| (-0.5 * other.excess.max(0.0)).exp()).collect();
    let all = 1.0 + weights.iter().sum::<f64>();
    let apart = |other: &Motion| {
        let across = tangent * other.u();
        // The opposite direction lies along any axis.
        let axis = across.try_normalize(f64::EPSILON).unwrap_or(Vector2::x()) * motion.angle_to(other);
        let turn = other.w() - motion.w();
        Vector5::new(axis.x, axis.y, turn.x, turn.y, turn.z)
    };
    let added = alternatives.iter().zip(weights).map(|(other, weight)| {
        let apart = apart(&other.motion);
        apart * apart.transpose() * (weight / all)
    });
    added.sum()
}

/// The alternatives without those within `same` degrees of an earlier one.
pub(crate) fn different(alternatives: impl Iterator<Item = Alternative>, same: f64) -> Vec<Alternative> {
    let mut kept: Vec<Alternative> = Vec::new();
    for other in alternatives {
        if kept.iter().all(|known| known.motion.angle_to(&other.motion).to_degrees() > same) {
            kept.push(other);
        }
    }
    kept
}

/// The most likely motion near `start` that has no depth behind the camera, and its cost.
fn in_front(observations: &Observations, start: &Motion) -> (Motion, f64) {
    let effort = StoppingCriteria { steps: 30, tolerance: 1e-7, deviations: 0.0 };
    let sums = |motion: &Motion, tangent: &Matrix2x3<f64>| front_equations(observations, motion, tangent);
    let found = descend(*start, effort, observations.n, sums);
    (found.motion, found.equations.cost)
}

/// The opposite of a motion, with the rotation that suits it best; `None` where the depths exclude it.
fn opposite(observations: &Observations, motion: &Motion, rng: CounterRng) -> Option<Alternative> {
    let searched = &*at_most(observations, SEARCHED, rng);
    let [own, opposite] = [*motion, motion.reversed()].map(|start| in_front(searched, &start));
    // One that turned back is no other motion.
    let turned = opposite.0.u().dot(&motion.u()) < 0.0;
    let excess = (opposite.1 - own.1) * observations.n as f64 / searched.n as f64;
    (turned && excess < SURE).then_some(Alternative { motion: opposite.0, excess })
}

/// The 0.95 quantile of chi-squared with two degrees of freedom: of the equations for a direction, once the
/// rotation suits it.
const CHI2_OF_DIRECTION: f64 = 5.99;

/// Most doubtful directions whose depth maps are compared, the likeliest by what else is known of them.
const COMPARED: usize = 12;

/// Whether any direction farther than the covariance has it explains the flow of at most [`MANY`] points as
/// well as the best of the `motions` (the estimate and maximum likelihood's), depth signs included. `own`:
/// standard deviation of the estimate, degrees.
fn far(observations: &Observations, motions: &[Motion], own: f64, rng: CounterRng) -> bool {
    let fewer = (observations.n as f64 / observations.n.min(MANY) as f64).sqrt();
    let searched = &*at_most(observations, MANY, rng);
    let (first, spread) = (motions[0].u(), (searched.n as f64).sqrt());
    // A direction with the rotation and the sign that suit it best, `J` and the depths behind the camera.
    let tested = |u: &Vector3<f64>, limit: f64| {
        let (w, cost) = best_rotation(searched, u).filter(|(_, cost)| *cost < limit)?;
        let signs = [Motion::of(u, &w), Motion::of(&-u, &w)];
        let behind = signs.map(|motion| equations(searched, &motion, &tangents(&motion.u()), None).behind);
        let better = usize::from(behind[1] < behind[0]);
        Some((signs[better], cost + behind[better]))
    };
    let known: Vec<(Motion, f64)> = motions.iter().filter_map(|motion| tested(&motion.u(), f64::INFINITY)).collect();
    let Some((best, least)) = known.iter().min_by(|a, b| a.1.total_cmp(&b.1)) else { return false };
    let limit = least + PLAUSIBLE;
    let mut doubts = evaluate(|u| {
        let angle = first.cross(u).norm().atan2(first.dot(u).abs()).to_degrees();
        let is_farther = |deviations: f64| angle > deviations * own * fewer + SPACING;
        let (motion, cost) = tested(u, if is_farther(DISTINCT) { limit + 4.0 * spread } else { 0.0 })?;
        let decides = cost < limit && is_farther(FAR);
        (decides || cost < limit + fluctuation(searched, best, &motion)).then_some((motion, cost, decides))
    });
    if doubts.is_empty() || doubts.iter().any(|(.., decides)| *decides) {
        return !doubts.is_empty();
    }
    if !keeps("motion3d.region_by_chance") {
        return false;
    }
    doubts.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut doubts: Vec<_> = doubts.into_iter().take(COMPARED).map(|(motion, cost, _)| (motion, cost)).collect();
    // One whose residuals are larger by chance has depths as smooth, and the estimating equation holds there.
    let mut smoother = depth_smoother(searched, Smoother::Auto, rng.stream(1));
    let cost = |(motion, cost): &(Motion, f64)| cost + smoother.cost(depths(searched, motion).measured());
    let limit = known.iter().map(cost).fold(f64::INFINITY, f64::min) + spread;
    doubts.retain(|doubt| cost(doubt) < limit);
    doubts.iter().any(|(motion, _)| is_consistent(searched, motion, &mut smoother))
}

/// Two standard deviations of the difference of two directions' `J` by chance, `2 sqrt(sum sin^2 phi)` with
/// the angles `phi` between their epipolar lines: their residuals are different components of the noise.
fn fluctuation(observations: &Observations, one: &Motion, other: &Motion) -> f64 {
    let turned = |k: usize| {
        let g = observations.row(k).g;
        let (a, b) = (g * one.u(), g * other.u());
        let squares = a.norm_squared() * b.norm_squared();
        if squares > observations.floor.powi(2) { a.perp(&b).powi(2) / squares } else { 0.0 }
    };
    4.0 * (0..observations.n).map(turned).sum::<f64>().sqrt()
}

/// Whether the estimating equation holds at a motion but for chance: of `g = sum W^t e` with weights from
/// smoothed depths, `g^t (sum W^t W)^-1 g` is chi-squared with the two unknowns of the direction, as the
/// rotation is the best.
fn is_consistent(observations: &Observations, motion: &Motion, smoother: &mut SiteSmoother) -> bool {
    let tangent = tangents(&motion.u());
    let nu = smoother.smooth(depths(observations, motion).measured()).value;
    let at = Weighted { motion, tangent: &tangent, nu: &nu };
    let (value, _) = Bilinear::new(observations, &at, 0.0).at(motion, &tangent);
    let factor = information(observations, &at, 0.0).cholesky();
    factor.is_some_and(|factor| value.dot(&factor.solve(&value)) < CHI2_OF_DIRECTION)
}
