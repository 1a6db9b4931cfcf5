//! From a solution on the inliers to what is told about every point that was given.

use super::correlated_noise::{Weighted, together, turning};
use super::degenerate::RotationOnly;
use super::nonlinearity::departure;
use super::rotation_prior::{Grown, contradiction, rotation_contradiction};
use super::systematic_errors;
use super::systematic_errors::{CommonEffect, CommonErrors, Moved, moved};
use crate::motion3d::contact::{Rates, Slopes};
use crate::motion3d::kernels::{Depths, depths, equations, information};
use crate::motion3d::model::camera::to_plane;
use crate::motion3d::model::derotation::HalfWay;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::options::{Flow, MotionOptions};
use crate::motion3d::model::result::{Alternative, Likelihood, MotionEstimate, Status, UNKNOWN, axes, nested};
use crate::motion3d::robust::{Consensus, Told, among_strays};
use crate::motion3d::solver::covariance::{Matrix5, Plugged, direction_deviation, plugged};
use crate::motion3d::solver::efficient::Efficient;
use crate::motion3d::solver::likelihood::Candidate;
use nalgebra::{Matrix2x3, Matrix3, Vector3};
use rayon::prelude::*;
use std::borrow::Cow;

/// Fewest points that a thread is worth its while for.
const TOGETHER: usize = 1000;

/// A motion found on the inliers.
pub(crate) struct Solution {
    pub motion: Motion,
    pub tangent: Matrix2x3<f64>,
    /// `None` where nothing is known.
    pub covariance: Option<Matrix5>,
    /// What is in it of errors that all flow has in common.
    common: CommonEffect,
    /// What it was made of.
    grown: Option<Grown>,
    pub status: Status,
    pub alternatives: Vec<Alternative>,
    likelihood: Likelihood,
    /// Depths in the weights, where they were smoothed, and their variances where these are known.
    smooth: Option<Vec<f64>>,
    variance: Option<Vec<f64>>,
    fell_back: bool,
}

impl Solution {
    /// Maximum likelihood, and what became of the smoothed weights, which were `wanted` or only needed for
    /// maximum likelihood's covariance.
    pub fn new(chosen: &Candidate, plugged: Option<&Plugged>, improved: Option<Efficient>, wanted: bool) -> Self {
        let minimum = &chosen.minimum;
        let likelihood = Likelihood {
            motion: minimum.motion,
            covariance: plugged.map_or(UNKNOWN, |plugged| nested(&plugged.likelihood)),
            tangent: axes(&minimum.tangent),
            cost: minimum.equations.cost,
        };
        let plain = Self {
            motion: minimum.motion,
            tangent: minimum.tangent,
            covariance: plugged.map(|plugged| plugged.likelihood),
            common: CommonEffect::default(),
            grown: None,
            status: Status::Ok,
            alternatives: Vec::new(),
            likelihood,
            smooth: None,
            variance: None,
            fell_back: wanted && improved.is_none(),
        };
        match improved {
            Some(improved) if wanted => Self {
                motion: improved.motion,
                tangent: improved.tangent,
                covariance: Some(improved.covariance),
                smooth: Some(improved.smooth),
                variance: improved.variance,
                ..plain
            },
            Some(improved) => Self { covariance: Some(departure(minimum, &improved)), ..plain },
            None => plain,
        }
    }

    /// Takes into account that some of the points that obey are strays. Where depths are `given` for the
    /// weights, which may be wrong, the motion stays.
    pub fn among_strays(&mut self, all: &Observations, known: &Consensus, given: bool) {
        let Some(covariance) = self.covariance else { return };
        let from = Told { motion: self.motion, tangent: self.tangent, covariance };
        let smooth = self.smooth.as_deref().filter(|_| !given);
        let Some(told) = among_strays(all, known, &from, smooth, !given) else { return };
        (self.motion, self.tangent) = (told.motion, told.tangent);
        self.covariance = Some(told.covariance);
    }

    /// Takes errors into the covariance that go together over a length, in the unit of the points.
    pub fn go_together(&mut self, inliers: &Observations, flow: &Flow<'_>, length: Option<f64>) {
        let (Some(covariance), Some(length)) = (self.covariance, length) else { return };
        let nu = self.weights(inliers);
        let at = Weighted { motion: &self.motion, tangent: &self.tangent, nu: &nu };
        self.covariance = together(&covariance, inliers, &at, flow, length);
    }

    /// What errors do that all flow has in common.
    pub fn in_common(&self, inliers: &Observations, flow: &Flow<'_>, common: &CommonErrors) -> CommonEffect {
        let Some(covariance) = self.covariance else { return CommonEffect::default() };
        let nu = self.weights(inliers);
        let at = Weighted { motion: &self.motion, tangent: &self.tangent, nu: &nu };
        let moved = if common.offset > 0.0 { moved(inliers, &at) } else { Moved::zeros() };
        common.on(&covariance, &self.motion, inliers.prior.as_ref(), (&moved, &to_plane(flow.camera())))
    }

    /// Has in its covariance, multiplied by `wider`, what errors do that all flow has in common.
    pub fn widen(&mut self, wider: f64, common: CommonEffect) {
        self.grown = self.covariance.map(|own| Grown { own, wider, common: common.added() });
        self.covariance = self.grown.as_ref().map(Grown::covariance);
        self.common = common;
    }

    /// Whether the flow contradicts what is known beforehand of the rotation; the covariance then reaches as
    /// far as the motion that the flow tells by itself.
    pub fn contradicted(&mut self, inliers: &Observations) -> bool {
        let (Some(known), Some(grown)) = (inliers.prior.as_ref(), &self.grown) else { return false };
        let told = if let Some(nu) = &self.smooth {
            information(inliers, &self.motion, &self.tangent, nu, 0.0)
        } else {
            let here = equations(inliers, &self.motion, &self.tangent, None);
            here.h - here.p
        };
        let Some(apart) = contradiction(known, &self.motion.w(), &told, grown) else { return false };
        self.covariance = Some(grown.covariance() + apart * apart.transpose());
        true
    }

    /// The depths in the weights, as long as the planes.
    fn weights(&self, inliers: &Observations) -> Cow<'_, [f64]> {
        let own = || Cow::Owned(depths(inliers, &self.motion).nu);
        self.smooth.as_deref().map_or_else(own, Cow::Borrowed)
    }
}

/// From inverse depths in the rows to those half way in time.
fn half_way(points: &Observations, motion: &Motion) -> HalfWay {
    points.turn.map_or_else(HalfWay::default, |turn| turn.half_way(&motion.u()))
}

/// Puts the results of usable points where they came from; others stay as they are.
fn scatter(to: &mut [f64], observations: &Observations, from: impl Fn(usize) -> f64) {
    for (k, &source) in observations.source.iter().enumerate() {
        to[source as usize] = from(k);
    }
}

/// Everything that is told about a motion.
pub(crate) fn report(
    flow: &Flow<'_>,
    all: &Observations,
    inliers: &Observations,
    solution: &Solution,
    sigma: f64,
) -> MotionEstimate {
    let mut out = MotionEstimate::nothing(flow.len(), solution.status, sigma);
    let motion = &solution.motion;
    out.motion = *motion;
    out.likelihood = solution.likelihood;
    out.alternatives.clone_from(&solution.alternatives);
    out.efficient = solution.smooth.is_some();
    out.fell_back = solution.fell_back;
    out.tangent = axes(&solution.tangent);
    out.common = solution.common;
    if let Some(covariance) = &solution.covariance {
        out.covariance = nested(covariance);
        out.direction_std = direction_deviation(covariance);
        out.rotation_std = std::array::from_fn(|i| covariance[(2 + i, 2 + i)].sqrt());
    }
    if let Some(plugged) = plugged(&equations(inliers, motion, &solution.tangent, None)) {
        out.bound = nested(&plugged.bound);
    }
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

/// Inverse depths and their variances for times to contact, by source: the smoothed ones where there are any,
/// else the point's own.
fn likeliest(out: &MotionEstimate, inliers: &Observations, solution: &Solution) -> Vec<(f64, f64)> {
    let half_way = half_way(inliers, &solution.motion);
    let own = out.inverse_depth.iter().zip(&out.inverse_depth_std);
    let mut depths: Vec<(f64, f64)> = own.map(|(nu, deviation)| (*nu, deviation * deviation)).collect();
    if let (Some(nu), Some(variance)) = (&solution.smooth, &solution.variance) {
        for (k, &source) in inliers.source.iter().enumerate() {
            depths[source as usize] = (half_way.depth(nu[k]), variance[k] * half_way.slope(nu[k]).powi(2));
        }
    }
    depths
}

/// Times to contact with their deviations, by first order from those of the depth and of the motion; and the
/// rate of approach of all inliers together.
fn contact(out: &mut MotionEstimate, all: &Observations, inliers: &Observations, seen: &Depths, solution: &Solution) {
    let rates = Rates::new(&out.uncertain());
    let likeliest = likeliest(out, inliers, solution);
    let u_z = solution.motion.u().z;
    let told = |k: usize| {
        let (nu, variance) = likeliest[all.source[k] as usize];
        let row = all.row(k);
        let slopes = rates.slopes(&row, nu);
        (rates.contact(nu, variance, &slopes), slopes)
    };
    let told: Vec<((f64, f64), Slopes)> = (0..all.n).into_par_iter().with_min_len(TOGETHER).map(told).collect();
    // Summed in one order, whoever computed them.
    let (mut weights, mut sum, mut slopes) = (0.0, 0.0, Slopes::default());
    for (k, (contact, own)) in told.iter().enumerate() {
        let source = all.source[k] as usize;
        (out.time_to_contact[source], out.time_to_contact_std[source]) = *contact;
        if out.inliers[source] && seen.s2[k] > 0.0 {
            weights += seen.s2[k];
            sum += seen.s2[k] * seen.nu[k] * u_z;
            slopes.add(own, seen.s2[k]);
        }
    }
    let rate = sum / weights;
    out.approach = (rate, (u_z * u_z / weights + rates.variance(rate, &slopes.times(1.0 / weights))).sqrt());
}

/// What is told about a camera that only turns, or stands still.
pub(crate) fn rotation_report(
    flow: &Flow<'_>,
    all: &Observations,
    inliers: &Observations,
    rotation: &RotationOnly,
    sigma: f64,
    options: &MotionOptions,
) -> MotionEstimate {
    let mut out = MotionEstimate::nothing(flow.len(), Status::RotationOnly, sigma);
    let moved = systematic_errors::turned(inliers, &rotation.covariance) * to_plane(flow.camera());
    let mut covariance = rotation.covariance;
    if let Some(length) = options.correlation_length.filter(|length| *length > 0.0) {
        covariance = turning(&covariance, inliers, &rotation.rotation, flow, length);
    }
    let common = options.common.added_to_rotation(&rotation.rotation, &moved);
    if let Some(known) = &inliers.prior
        && let Some((added, alone)) =
            rotation_contradiction(known, &rotation.rotation, &rotation.covariance, &covariance, &common)
    {
        covariance += added;
        out.alternatives.push(alone);
    }
    covariance += common;
    turned(&mut out, &rotation.rotation, &covariance, rotation.chi2, &all.source);
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
pub(crate) fn turned(
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
