//! The status of a motion, and which directions explain the flow as well as the estimate does.
//!
//! Residuals of two directions are different components of the noise: with epipolar lines at an angle `phi`
//! to each other the difference of `J` has the variance `4 sum sin^2 phi`. Where depths are mostly noise that
//! can hide the truth behind a lower minimum. Two quantities fluctuate less: the estimating equation, which
//! is zero at the true direction but for the noise of its few unknowns, and the depth map, which a wrong
//! motion makes rough.

use super::planar_twin::planar_twin;
use super::solution::Solution;
use crate::ablation::keeps;
use crate::math::random::CounterRng;
use crate::motion3d::kernels::{Bilinear, best_rotation, depths, equations, front_equations, information};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::options::Smoother;
use crate::motion3d::model::result::{Alternative, Status};
use crate::motion3d::model::rows::tangents;
use crate::motion3d::model::whitening::Whitening;
use crate::motion3d::solver::covariance::{PLAUSIBLE, determined, direction_deviation};
use crate::motion3d::solver::likelihood::SAME;
use crate::motion3d::solver::refine::{MANY, StoppingCriteria, descend};
use crate::motion3d::solver::smoothing::DepthSmoother;
use crate::motion3d::solver::starts::{SEARCHED, at_most, evaluate};
use nalgebra::{Matrix2x3, Vector3};

/// Below so many points several motions may explain them exactly.
const FEW: usize = 12;

/// Standard deviation of the direction, degrees, beyond which it is not known.
pub(crate) const WIDE: f64 = 20.0;

/// Plausible directions reach 3.3 standard deviations where the covariance is right; those looked at are
/// [`SPACING`] degrees apart, half of that from one of them.
const FAR: f64 = 4.0;
const SPACING: f64 = 4.0;

/// The same in the estimate's own standard deviations, for directions that the smoothed weights do not
/// exclude.
const CONSISTENT: f64 = 3.0;

/// Squared depths behind the camera, in units of their standard deviation, that exclude the other motion of a
/// plane.
const EXCLUDED: f64 = 25.0;

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
    let distinct = (3.0 * if deviation.is_finite() { deviation } else { 0.0 }).to_radians().max(1e-6);
    let twin = planar_twin(whitening, inliers, &solution.motion, distinct, unknown);
    let twin = twin.map(|twin| Alternative { excess: twin.excess - solution.minimum.equations.behind, ..twin });
    let twin = twin.filter(|twin| twin.excess < EXCLUDED);
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
}

/// The alternatives without those within `same` degrees of an earlier one.
fn different(alternatives: impl Iterator<Item = Alternative>, same: f64) -> Vec<Alternative> {
    let mut kept: Vec<Alternative> = Vec::new();
    for other in alternatives {
        if kept.iter().all(|known| known.motion.angle_to(&other.motion).to_degrees() > same) {
            kept.push(other);
        }
    }
    kept
}

/// Squared standard deviations by which the opposite must be worse to be excluded: a chance of about 1 in
/// 100.
pub(crate) const SURE: f64 = 9.0;

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

/// Standard deviations that chance may add to a difference of `J`.
const CHANCE: f64 = 2.0;

/// Depth maps whose costs differ by less than this times `sqrt(n)` are as smooth.
const AS_SMOOTH: f64 = 1.0;

/// Most doubtful directions whose depth maps are compared, the likeliest by what else is known of them.
const COMPARED: usize = 12;

/// A direction with the rotation and the sign that suit it best.
#[derive(Debug, Clone, Copy)]
struct TestedDirection {
    pub motion: Motion,
    /// `J` and the depths behind the camera.
    pub cost: f64,
    /// From the estimate's, of either sign, degrees.
    angle: f64,
}

/// Whether any direction farther than the covariance has it explains the flow of at most [`MANY`] points as
/// well as the best of the `motions` (the estimate and maximum likelihood's), depth signs included. `own`:
/// standard deviation of the estimate, degrees.
fn far(observations: &Observations, motions: &[Motion], own: f64, rng: CounterRng) -> bool {
    let fewer = (observations.n as f64 / observations.n.min(MANY) as f64).sqrt();
    let beyond = FAR * own * fewer + SPACING;
    let beyond_by_chance = CONSISTENT * own * fewer + SPACING;
    let searched = &*at_most(observations, MANY, rng);
    let first = motions[0].u();
    let known: Vec<TestedDirection> =
        motions.iter().filter_map(|motion| test_direction(searched, &motion.u(), &first)).collect();
    let Some(best) = known.iter().min_by(|a, b| a.cost.total_cmp(&b.cost)) else { return false };
    let limit = best.cost + PLAUSIBLE;
    let widest = limit + CHANCE * 2.0 * (searched.n as f64).sqrt();
    let mut doubts = evaluate(|u| {
        // Signs are looked at only where the residuals alone would do.
        best_rotation(searched, u).filter(|(_, cost)| *cost < widest)?;
        let tested = test_direction(searched, u, &first)?;
        let chance = || CHANCE * fluctuation(searched, &best.motion, &tested.motion);
        let doubtful = (tested.angle > beyond && tested.cost < limit)
            || (tested.angle > beyond_by_chance && tested.cost < limit + chance());
        doubtful.then_some(tested)
    });
    if doubts.iter().any(|tested| tested.angle > beyond && tested.cost < limit) {
        return true;
    }
    if !keeps("motion3d.region_by_chance") {
        return false;
    }
    doubts.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    doubts.truncate(COMPARED);
    as_likely(searched, &known, &doubts, rng.stream(1))
}

fn test_direction(observations: &Observations, u: &Vector3<f64>, first: &Vector3<f64>) -> Option<TestedDirection> {
    let (w, cost) = best_rotation(observations, u)?;
    let signs = [Motion::of(u, &w), Motion::of(&-u, &w)];
    let behind = signs.map(|motion| equations(observations, &motion, &tangents(&motion.u()), None).behind);
    let better = usize::from(behind[1] < behind[0]);
    let angle = first.cross(u).norm().atan2(first.dot(u).abs()).to_degrees();
    Some(TestedDirection { motion: signs[better], cost: cost + behind[better], angle })
}

/// Standard deviation of the difference of two directions' `J` by chance, `2 sqrt(sum sin^2 phi)`.
fn fluctuation(observations: &Observations, one: &Motion, other: &Motion) -> f64 {
    let turned = |k: usize| {
        let g = observations.row(k).g;
        let (a, b) = (g * one.u(), g * other.u());
        let squares = a.norm_squared() * b.norm_squared();
        let cross = a.x * b.y - a.y * b.x;
        if squares > observations.floor * observations.floor { cross * cross / squares } else { 0.0 }
    };
    2.0 * (0..observations.n).map(turned).sum::<f64>().sqrt()
}

/// Whether one of the doubtful directions has depths as smooth as those of the known motions, and is
/// consistent with the estimating equation.
fn as_likely(points: &Observations, known: &[TestedDirection], doubts: &[TestedDirection], rng: CounterRng) -> bool {
    if doubts.is_empty() {
        return false;
    }
    let mut smoother = DepthSmoother::new(points, Smoother::Auto, rng);
    let cost = |tested: &TestedDirection| tested.cost + smoother.cost(&depths(points, &tested.motion));
    let limit = known.iter().map(cost).fold(f64::INFINITY, f64::min) + AS_SMOOTH * (points.n as f64).sqrt();
    let smooth: Vec<_> = doubts.iter().filter(|doubt| cost(doubt) < limit).collect();
    smooth.into_iter().any(|tested| consistent(points, &tested.motion, &mut smoother))
}

/// Whether the estimating equation holds at a motion but for chance: of `g = sum W^t e` with weights from
/// smoothed depths, `g^t (sum W^t W)^-1 g` is chi-squared with the two unknowns of the direction, as the
/// rotation is the best.
fn consistent(observations: &Observations, motion: &Motion, smoother: &mut DepthSmoother) -> bool {
    let tangent = tangents(&motion.u());
    let nu = smoother.smooth(&depths(observations, motion)).nu;
    let (value, _) = Bilinear::new(observations, motion, &tangent, &nu, 0.0).at(motion, &tangent);
    let Some(factor) = information(observations, motion, &tangent, &nu, 0.0).cholesky() else { return false };
    value.dot(&factor.solve(&value)) < CHI2_OF_DIRECTION
}
