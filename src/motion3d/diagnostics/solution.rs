//! A motion found on the inliers, and what a linear theory of independent points leaves out of its
//! covariance.

use super::{correlated_noise::correlated_covariance, rotation::contradiction, rotation::of_flow_alone};
use crate::motion3d::kernels::{Weighted, depths, equations, information};
use crate::motion3d::model::input::{Flow, to_plane};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::options::{MotionOptions, SystematicErrors};
use crate::motion3d::model::result::{Alternative, Status, SystematicEffect};
use crate::motion3d::model::rows::Matrix5;
use crate::motion3d::robust::{Consensus, weighted_by_posterior};
use crate::motion3d::solver::covariance::{PluginCovariances, inverse};
use crate::motion3d::solver::efficient::{Efficient, nonlinearity_covariance};
use crate::motion3d::solver::refine::Minimum;
use nalgebra::{Matrix2x3, Vector1};
use std::borrow::Cow;

/// A motion found on the inliers.
pub(crate) struct Solution {
    pub motion: Motion,
    pub tangent: Matrix2x3<f64>,
    /// `None` where nothing is known.
    pub covariance: Option<Matrix5>,
    /// What is in it of errors that all flow has in common.
    pub systematic_errors: SystematicEffect,
    /// Maximum likelihood.
    pub minimum: Minimum,
    /// Its covariance; `None` where the depths are mostly noise, so that nothing is known of it.
    pub plugged: Option<PluginCovariances>,
    /// Whether the covariance describes the shape of the confidence region.
    pub described: bool,
    /// Another solution that is about as likely, or the motion of the flow alone where that contradicts what
    /// is known of the rotation.
    pub undecided: Option<Alternative>,
    pub status: Status,
    pub alternatives: Vec<Alternative>,
    /// Depths in the weights, where they were smoothed, and their variances where these are known.
    pub smooth: Option<Vec<f64>>,
    pub variance: Option<Vec<f64>>,
    pub fell_back: bool,
}

impl Solution {
    /// Maximum likelihood, and what became of the smoothed weights, which were `wanted` or only needed for
    /// maximum likelihood's covariance.
    #[expect(clippy::large_types_passed_by_value, reason = "all of it becomes part of the solution")]
    pub fn new(
        minimum: Minimum,
        plugged: Option<PluginCovariances>,
        improved: Option<Efficient>,
        wanted: bool,
    ) -> Self {
        let mut out = Self {
            motion: minimum.motion,
            tangent: minimum.tangent,
            covariance: plugged.as_ref().map(|plugged| plugged.likelihood),
            systematic_errors: SystematicEffect::default(),
            minimum,
            plugged,
            described: true,
            undecided: None,
            status: Status::Ok,
            alternatives: Vec::new(),
            smooth: None,
            variance: None,
            fell_back: wanted && improved.is_none(),
        };
        if let Some(better) = improved {
            if wanted {
                (out.motion, out.tangent, out.covariance) = (better.motion, better.tangent, Some(better.covariance));
                (out.smooth, out.variance) = (Some(better.smooth), better.variance);
            } else {
                out.covariance = Some(nonlinearity_covariance(&minimum, &better));
            }
        }
        out
    }

    /// Takes into account that some of the inliers are so by chance. Where depths are `given` for the
    /// weights, which may be wrong, the motion stays.
    pub fn weighted_by_posterior(&mut self, all: &Observations, known: &Consensus, given: bool) {
        let Some(covariance) = self.covariance else { return };
        let from = (&self.motion, &self.tangent, &covariance);
        let smooth = self.smooth.as_deref().filter(|_| !given);
        let Some((motion, tangent, grown)) = weighted_by_posterior(all, known, from, smooth, !given) else { return };
        (self.motion, self.tangent, self.covariance) = (motion, tangent, Some(grown));
    }

    /// Inflates the covariance: by correlated errors, by the factor `wider` and by systematic errors. Where
    /// the flow contradicts a known rotation it also reaches the motion of the flow alone.
    pub fn inflate(&mut self, inliers: &Observations, flow: &Flow<'_>, options: &MotionOptions, wider: f64) {
        let Some(independent) = self.covariance else { return };
        let nu = self.smooth.as_deref().map_or_else(|| Cow::Owned(depths(inliers, &self.motion).nu), Cow::Borrowed);
        let at = Weighted { motion: &self.motion, tangent: &self.tangent, nu: &nu };
        let errors = options.systematic_errors();
        let squares = information(inliers, &at, 0.0);
        let effect = match inverse(&squares).filter(|_| errors != SystematicErrors::default()) {
            Some(inverse) => errors.on((&inverse, &response(inliers, &at)), &at.motion.w(), &to_plane(flow.camera())),
            None => SystematicEffect::default(),
        };
        let own = match options.correlation() {
            Some(length) => correlated_covariance(&independent, inliers, &at, flow, length),
            None => Some(independent),
        };
        (self.systematic_errors, self.covariance) = (effect, own);
        let (Some(own), common) = (own, effect.added()) else { return };
        let mut covariance = own * wider + common;
        if let Some(known) = &inliers.prior {
            let here = equations(inliers, &self.motion, &self.tangent, None);
            let precision = if self.smooth.is_some() { squares } else { here.h - here.p };
            if let Some(apart) = contradiction(known, &self.motion.w(), &precision, (&own, wider, &common)) {
                covariance += apart * apart.transpose();
                self.undecided = Some(of_flow_alone(inliers, &self.motion));
            }
        }
        self.covariance = Some(covariance);
    }
}

/// How the equations respond to more rotation and to a displacement of all flow.
fn response(inliers: &Observations, at: &Weighted<'_>) -> Matrix5 {
    let one = |k: usize| inliers.row(k).measurement().response(Some((at.motion, at.tangent)), &Vector1::new(at.nu[k]));
    (0..inliers.n).map(one).sum()
}
