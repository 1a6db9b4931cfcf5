//! Assembles the result for all given points from a solution on the inliers.

use super::contact::{Rates, Slopes};
use super::correlated_noise::correlated_rotation_covariance;
use super::rotation::{RotationOnly, contradicted_rotation};
use super::solution::Solution;
use crate::math::TRUNCATED_INFORMATION;
use crate::motion3d::kernels::{Equations, depths, equations};
use crate::motion3d::model::input::{Flow, to_plane};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::{CHUNK, Observations};
use crate::motion3d::model::options::MotionOptions;
use crate::motion3d::model::result::{Alternative, Likelihood, MotionEstimate, Status};
use crate::motion3d::model::rows::{Matrix5, MidpointDepth, nested};
use crate::motion3d::robust;
use crate::motion3d::robust::Consensus;
use crate::motion3d::solver::covariance::{PluginCovariances, direction_deviation, plugged};
use crate::motion3d::solver::refine::Minimum;
use crate::parallel;
use nalgebra::{Matrix2x3, Matrix3, Vector1};

/// The whole result of a motion.
pub(crate) fn report(
    flow: &Flow<'_>,
    all: &Observations,
    inliers: &Observations,
    solution: &Solution,
    noise_std: f64,
) -> MotionEstimate {
    let mut out = MotionEstimate::nothing(flow.len(), solution.status, noise_std);
    let motion = &solution.motion;
    let here = equations(inliers, motion, &solution.tangent, None);
    set_motion(&mut out, motion, &solution.tangent, solution.covariance.as_ref(), &here);
    out.likelihood = likelihood(&solution.minimum, solution.plugged.as_ref());
    out.alternatives.clone_from(&solution.alternatives);
    out.efficient = solution.smooth.is_some();
    out.fell_back = solution.fell_back;
    out.systematic_errors = solution.systematic_errors;
    let (rates, seen, u_z) = (Rates::new(&out.uncertain()), depths(all, motion), motion.u().z);
    let half_way = all.turn.map_or_else(MidpointDepth::default, |turn| turn.half_way(&motion.u()));
    let mut place = vec![None; flow.len()];
    for (k, &source) in inliers.source.iter().enumerate() {
        place[source as usize] = Some(k);
    }
    // Depths along a motion of unknown covariance are as uncertain.
    let known = if solution.covariance.is_some() { 1.0 } else { f64::NAN };
    // The likeliest depth is smoothed where possible, with its variance.
    let rated = |k: usize| {
        let own = (half_way.depth(seen.nu[k]), known * half_way.slope(seen.nu[k]).powi(2) / seen.s2[k]);
        let inlier = place[all.source[k] as usize];
        let smooth = inlier.map(|place| solution.smooth.as_ref().map_or(own.0, |nu| half_way.depth(nu[place])));
        let likeliest = match (inlier, &solution.smooth, &solution.variance) {
            (Some(place), Some(nu), Some(variance)) => {
                (half_way.depth(nu[place]), variance[place] * half_way.slope(nu[place]).powi(2))
            }
            _ => own,
        };
        let slopes = rates.slopes(&all.row(k).measurement(), &Vector1::new(likeliest.0));
        (own, smooth, rates.contact(likeliest.0, likeliest.1, &slopes), slopes)
    };
    let rated = parallel::map_range(all.n, CHUNK, rated);
    // The rate of approach of all inliers together, summed in one order, whoever computed them.
    let (mut weights, mut sum, mut slopes) = (0.0, 0.0, Slopes::zeros());
    for (k, ((nu, variance), smooth, contact, own)) in rated.into_iter().enumerate() {
        let source = all.source[k] as usize;
        out.residuals[source] = seen.e[k];
        (out.inverse_depth[source], out.inverse_depth_std[source]) = (nu, variance.sqrt());
        (out.time_to_contact[source], out.time_to_contact_std[source]) = contact;
        if let Some(smooth) = smooth {
            (out.inverse_depth_smooth[source], out.inliers[source]) = (smooth, true);
            if variance.is_finite() {
                weights += 1.0 / variance;
                sum += nu * u_z / variance;
                slopes += own / variance;
            }
        }
    }
    let rate = sum / weights;
    out.approach = (rate, (u_z * u_z / weights + rates.variance(rate, &(slopes / weights))).sqrt());
    out
}

/// Maximum likelihood beside the solution that is returned.
pub(crate) fn likelihood(minimum: &Minimum, plugged: Option<&PluginCovariances>) -> Likelihood {
    Likelihood {
        motion: minimum.motion,
        covariance: plugged.map_or([[f64::NAN; 5]; 5], |plugged| nested(&plugged.likelihood)),
        tangent: nested(&minimum.tangent),
        cost: minimum.equations.cost,
    }
}

/// A motion with its covariance, where that is known, and its bound by the equations there.
pub(crate) fn set_motion(
    out: &mut MotionEstimate,
    motion: &Motion,
    tangent: &Matrix2x3<f64>,
    covariance: Option<&Matrix5>,
    here: &Equations,
) {
    (out.motion, out.tangent) = (*motion, nested(tangent));
    if let Some(covariance) = covariance {
        out.covariance = nested(covariance);
        out.direction_std = direction_deviation(covariance);
        out.rotation_std = std::array::from_fn(|i| covariance[(2 + i, 2 + i)].sqrt());
    }
    if let Some(plugged) = plugged(&here.h, &here.p).filter(|_| covariance.is_some()) {
        out.bound = nested(&plugged.bound);
    }
}

/// The result of a camera that only rotates, or stands still.
pub(crate) fn rotation_report(
    flow: &Flow<'_>,
    all: &Observations,
    inliers: &Observations,
    rotation: &RotationOnly,
    noise_std: f64,
    options: &MotionOptions,
) -> MotionEstimate {
    let mut out = MotionEstimate::nothing(flow.len(), Status::RotationOnly, noise_std);
    let (errors, unit) = (options.systematic_errors(), to_plane(flow.camera()));
    let widened = |rotation: &RotationOnly| {
        let RotationOnly { rotation: w, covariance, .. } = rotation;
        let own = options
            .correlation()
            .map_or(*covariance, |length| correlated_rotation_covariance(covariance, inliers, w, flow, length));
        own + rotation.systematic_error((0..inliers.n).map(|k| inliers.row(k).measurement()), &errors, &unit)
    };
    let mut covariance = widened(rotation);
    if let Some(alone) = contradicted_rotation(inliers, widened) {
        let apart = alone.rotation - rotation.rotation;
        covariance += apart * apart.transpose();
        let motion = Motion { translation: [f64::NAN; 3], rotation: alone.rotation.into() };
        let excess = alone.chi2 + inliers.pulled(&alone.rotation) - rotation.chi2;
        out.alternatives.push(Alternative { motion, excess });
    }
    let rest = (0..all.n).map(|k| all.row(k)).map(|row| (row.f - row.r * rotation.rotation).norm());
    report_rotation(&mut out, rotation, &covariance, all.source.iter().copied().zip(rest));
    for &source in &inliers.source {
        out.inliers[source as usize] = true;
    }
    out.approach = (0.0, f64::INFINITY);
    out
}

/// A rotation alone: its covariance, and no depth for any of the usable points, given with what is left of
/// their flow.
pub(crate) fn report_rotation(
    out: &mut MotionEstimate,
    rotation: &RotationOnly,
    covariance: &Matrix3<f64>,
    rest: impl Iterator<Item = (u32, f64)>,
) {
    out.motion.rotation = rotation.rotation.into();
    for i in 0..3 {
        for j in 0..3 {
            out.covariance[2 + i][2 + j] = covariance[(i, j)];
        }
        out.rotation_std[i] = covariance[(i, i)].sqrt();
    }
    (out.bound, out.likelihood.motion, out.likelihood.cost) = (out.covariance, out.motion, rotation.chi2);
    for (source, rest) in rest {
        let source = source as usize;
        out.residuals[source] = rest;
        (out.inverse_depth[source], out.inverse_depth_smooth[source]) = (0.0, 0.0);
        out.inverse_depth_std[source] = f64::INFINITY;
        (out.time_to_contact[source], out.time_to_contact_std[source]) = (f64::INFINITY, f64::INFINITY);
    }
}

/// Reports few points where some of high leverage decide alone, or where a rotation alone or low
/// signal-to-noise ratio may be due to outliers.
pub(crate) fn doubted(found: MotionEstimate, all: &Observations, kept: &Consensus) -> MotionEstimate {
    let unlikely = |shorter: f64| shorter <= 0.0;
    let few = match found.status {
        Status::Ok => robust::has_high_leverage(all, &found),
        Status::RotationOnly => {
            let inliers = found.residuals.iter().zip(&found.inliers).filter(|(_, inlier)| **inlier);
            let one_noise = robust::one_noise(inliers.map(|(rest, _)| *rest));
            kept.shorter.is_some_and(|shorter| !(unlikely(shorter) && one_noise))
        }
        Status::LowSnr => kept.shorter.is_some_and(|shorter| !unlikely(shorter)),
        _ => false,
    };
    if few { MotionEstimate { status: Status::FewPoints, ..found } } else { found }
}

/// Factor `f / (f - 2)` of a covariance in units of an estimated variance: the variance of Student's
/// distribution with `f` degrees of freedom (W. Gosset 1908). Truncated residuals (`cut`) have fewer. `None`
/// up to two, whose variance is infinite.
pub(crate) fn of_estimated_noise(points: usize, cut: bool) -> Option<f64> {
    let free = points.saturating_sub(5) as f64 * if cut { TRUNCATED_INFORMATION } else { 1.0 };
    (free > 2.0).then(|| free / (free - 2.0))
}
