//! Which directions explain the flow as well as the estimate does.
//!
//! Two directions leave different components of the noise as residuals: across lines that are turned by `phi`
//! against each other, the difference of `J` has the variance `4 sum sin^2 phi` in any case. Where depths
//! are mostly noise, that hides the truth behind a lower minimum. Two quantities do not fluctuate so:
//! the estimating equation, which at the true direction is zero but for the noise of its own few unknowns,
//! however wrong its weights; and the depth map, which a wrong motion makes rough.

use crate::ablation::keeps;
use crate::math::random::CounterRng;
use crate::motion3d::kernels::{Bilinear, best_rotation, depths, equations, information};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::options::Smoother;
use crate::motion3d::model::rows::tangents;
use crate::motion3d::solver::refine::MANY;
use crate::motion3d::solver::smoothing::DepthSmoother;
use crate::motion3d::solver::starts::{at_most, evaluate};
use nalgebra::Vector3;

/// The 0.95 quantile of chi-squared with five degrees of freedom.
pub(crate) const PLAUSIBLE: f64 = 11.07;

/// That with two: of the equations for a direction, once the rotation suits it.
const CONSISTENT: f64 = 5.99;

/// Standard deviations that chance may add to a difference of `J`.
const CHANCE: f64 = 2.0;

/// Depth maps whose costs differ by less than this times `sqrt(n)` are as smooth.
const AS_SMOOTH: f64 = 1.0;

/// Most doubtful directions whose depth maps are compared, the likeliest by what else is known of them.
const COMPARED: usize = 12;

/// Angles to the estimate, degrees, beyond which a direction is tested.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Farther {
    /// Directions whose residuals are as small.
    pub residuals: f64,
    /// Directions whose residuals may be larger by chance.
    pub chance: f64,
}

/// A direction with the rotation and the sign that suit it best.
#[derive(Debug, Clone, Copy)]
struct TestedDirection {
    pub motion: Motion,
    /// `J` and the depths behind the camera.
    pub cost: f64,
    /// From the estimate's, of either sign, degrees.
    angle: f64,
}

/// Whether any direction of the half sphere, farther from that of the first of `motions` (the estimate),
/// explains the flow of as many points as a search begins with as well as the best of these, depth signs included. A covariance is
/// that of one minimum; a whole line of minima shows here.
pub(crate) fn plausible_beyond(
    observations: &Observations,
    motions: &[Motion],
    farther: Farther,
    rng: CounterRng,
) -> bool {
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
        let doubtful = (tested.angle > farther.residuals && tested.cost < limit)
            || (tested.angle > farther.chance && tested.cost < limit + chance());
        doubtful.then_some(tested)
    });
    if doubts.iter().any(|tested| tested.angle > farther.residuals && tested.cost < limit) {
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
    value.dot(&factor.solve(&value)) < CONSISTENT
}
