//! Assembles the result for all given points from a solution on the inliers.

use super::contact::{Rates, Slopes};
use super::correlated_noise::correlated_rotation_covariance;
use super::rotation::{RotationOnly, contradicted_rotation};
use super::solution::{Solution, rotation_shift};
use crate::math::TRUNCATED_INFORMATION;
use crate::motion3d::kernels::{Depths, Equations, depths, equations};
use crate::motion3d::model::input::{Flow, to_plane};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::options::MotionOptions;
use crate::motion3d::model::result::{Alternative, Likelihood, MotionEstimate, Status, UNKNOWN};
use crate::motion3d::model::rows::{Matrix5, MidpointDepth, nested};
use crate::motion3d::model::whitening::TOGETHER;
use crate::motion3d::robust;
use crate::motion3d::robust::Consensus;
use crate::motion3d::solver::covariance::{PluginCovariances, direction_deviation, plugged};
use crate::motion3d::solver::refine::Minimum;
use nalgebra::{Matrix2x3, Matrix3, Vector3};
use rayon::prelude::*;

/// From inverse depths in the rows to those half way in time.
fn half_way(points: &Observations, motion: &Motion) -> MidpointDepth {
    points.turn.map_or_else(MidpointDepth::default, |turn| turn.half_way(&motion.u()))
}

/// Puts the results of usable points where they came from; others stay as they are.
fn scatter(to: &mut [f64], observations: &Observations, from: impl Fn(usize) -> f64) {
    for (k, &source) in observations.source.iter().enumerate() {
        to[source as usize] = from(k);
    }
}

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
    out.common = solution.common;
    let mut seen = depths(all, motion);
    scatter(&mut out.residuals, all, |k| seen.e[k]);
    let half_way = half_way(all, motion);
    for k in 0..all.n {
        (seen.nu[k], seen.s2[k]) = (half_way.depth(seen.nu[k]), seen.s2[k] / half_way.slope(seen.nu[k]).powi(2));
    }
    scatter(&mut out.inverse_depth, all, |k| seen.nu[k]);
    scatter(&mut out.inverse_depth_std, all, |k| 1.0 / seen.s2[k].sqrt());
    if let Some(smooth) = &solution.smooth {
        scatter(&mut out.inverse_depth_smooth, inliers, |k| half_way.depth(smooth[k]));
    } else {
        let own = &out.inverse_depth;
        scatter(&mut out.inverse_depth_smooth, inliers, |k| own[inliers.source[k] as usize]);
    }
    for &source in &inliers.source {
        out.inliers[source as usize] = true;
    }
    contact(&mut out, all, inliers, &seen, solution);
    out
}

/// Maximum likelihood beside the solution that is returned.
pub(crate) fn likelihood(minimum: &Minimum, plugged: Option<&PluginCovariances>) -> Likelihood {
    Likelihood {
        motion: minimum.motion,
        covariance: plugged.map_or(UNKNOWN, |plugged| nested(&plugged.likelihood)),
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
    if let Some(plugged) = plugged(&here.h, &here.p) {
        out.bound = nested(&plugged.bound);
    }
}

/// Times to contact with their standard deviations, by first order from the depth (smoothed where possible)
/// and the motion; and the rate of approach of all inliers together.
fn contact(out: &mut MotionEstimate, all: &Observations, inliers: &Observations, seen: &Depths, solution: &Solution) {
    let rates = Rates::new(&out.uncertain());
    let half_way = half_way(inliers, &solution.motion);
    let own = out.inverse_depth.iter().zip(&out.inverse_depth_std);
    let mut likeliest: Vec<(f64, f64)> = own.map(|(nu, deviation)| (*nu, deviation * deviation)).collect();
    if let (Some(nu), Some(variance)) = (&solution.smooth, &solution.variance) {
        for (k, &source) in inliers.source.iter().enumerate() {
            likeliest[source as usize] = (half_way.depth(nu[k]), variance[k] * half_way.slope(nu[k]).powi(2));
        }
    }
    let u_z = solution.motion.u().z;
    let rated = |k: usize| {
        let (nu, variance) = likeliest[all.source[k] as usize];
        let row = all.row(k);
        let slopes = rates.slopes(&row, nu);
        (rates.contact(nu, variance, &slopes), slopes)
    };
    let rated: Vec<((f64, f64), Slopes)> = (0..all.n).into_par_iter().with_min_len(TOGETHER).map(rated).collect();
    // Summed in one order, whoever computed them.
    let (mut weights, mut sum, mut slopes) = (0.0, 0.0, Slopes::zeros());
    for (k, (contact, own)) in rated.iter().enumerate() {
        let source = all.source[k] as usize;
        (out.time_to_contact[source], out.time_to_contact_std[source]) = *contact;
        if out.inliers[source] && seen.s2[k] > 0.0 {
            weights += seen.s2[k];
            sum += seen.s2[k] * seen.nu[k] * u_z;
            slopes += own * seen.s2[k];
        }
    }
    let rate = sum / weights;
    out.approach = (rate, (u_z * u_z / weights + rates.variance(rate, &(slopes / weights))).sqrt());
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
    let widened = |rotation: &RotationOnly| {
        let moved = rotation_shift(inliers, &rotation.covariance) * to_plane(flow.camera());
        let RotationOnly { rotation, covariance, .. } = rotation;
        let own = options
            .correlation()
            .map_or(*covariance, |length| correlated_rotation_covariance(covariance, inliers, rotation, flow, length));
        own + options.systematic_errors().added_to_rotation(rotation, &moved)
    };
    let mut covariance = widened(rotation);
    if let Some(alone) = contradicted_rotation(inliers, widened) {
        let apart = alone.rotation - rotation.rotation;
        covariance += apart * apart.transpose();
        let motion = Motion { translation: [f64::NAN; 3], rotation: alone.rotation.into() };
        let excess = alone.chi2 + inliers.pulled(&alone.rotation) - rotation.chi2;
        out.alternatives.push(Alternative { motion, excess });
    }
    report_rotation(&mut out, &rotation.rotation, &covariance, rotation.chi2, &all.source);
    let rest = |k: usize| {
        let row = all.row(k);
        (row.f - row.r * rotation.rotation).norm()
    };
    scatter(&mut out.residuals, all, rest);
    for &source in &inliers.source {
        out.inliers[source as usize] = true;
    }
    out.approach = (0.0, f64::INFINITY);
    out
}

/// A rotation alone: its covariance, and no depth for any of the usable points `source`.
pub(crate) fn report_rotation(
    out: &mut MotionEstimate,
    rotation: &Vector3<f64>,
    covariance: &Matrix3<f64>,
    cost: f64,
    source: &[u32],
) {
    out.motion.rotation = (*rotation).into();
    for i in 0..3 {
        for j in 0..3 {
            out.covariance[2 + i][2 + j] = covariance[(i, j)];
        }
        out.rotation_std[i] = covariance[(i, i)].sqrt();
    }
    out.bound = out.covariance;
    out.likelihood.motion = out.motion;
    out.likelihood.cost = cost;
    for &source in source {
        let source = source as usize;
        (out.inverse_depth[source], out.inverse_depth_smooth[source]) = (0.0, 0.0);
        out.inverse_depth_std[source] = f64::INFINITY;
        out.time_to_contact[source] = f64::INFINITY;
        out.time_to_contact_std[source] = f64::INFINITY;
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
/// distribution with `f` degrees of freedom (W. Gosset 1908). Truncated residuals (`cut`) have fewer.
pub(crate) fn of_estimated_noise(points: usize, cut: bool) -> f64 {
    let free = points.saturating_sub(5) as f64 * if cut { TRUNCATED_INFORMATION } else { 1.0 };
    let free = free.max(2.0 * 2.0);
    free / (free - 2.0)
}
