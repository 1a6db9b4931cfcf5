//! A motion found on the inliers, and what a linear theory of independent points leaves out of its
//! covariance.

use super::correlated_noise::{Weighted, correlated_covariance};
use super::rotation::{contradiction, of_flow_alone};
use crate::motion3d::kernels::{depths, equations, information, slopes};
use crate::motion3d::model::input::{Flow, to_plane};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::options::CommonErrors;
use crate::motion3d::model::result::{Alternative, CommonEffect, Moved, Status};
use crate::motion3d::model::rows::Matrix5;
use crate::motion3d::robust::{Consensus, weighted_by_posterior};
use crate::motion3d::solver::covariance::{PluginCovariances, inverse};
use crate::motion3d::solver::efficient::{Efficient, nonlinearity_covariance};
use crate::motion3d::solver::refine::Minimum;
use nalgebra::{Matrix2x3, Matrix3, Matrix3x2, RowVector2};
use std::borrow::Cow;

/// A motion found on the inliers.
pub(crate) struct Solution {
    pub motion: Motion,
    pub tangent: Matrix2x3<f64>,
    /// `None` where nothing is known.
    pub covariance: Option<Matrix5>,
    /// What is in it of errors that all flow has in common.
    pub common: CommonEffect,
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
        let plain = Self {
            motion: minimum.motion,
            tangent: minimum.tangent,
            covariance: plugged.as_ref().map(|plugged| plugged.likelihood),
            common: CommonEffect::default(),
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
        match improved {
            Some(improved) if wanted => Self {
                motion: improved.motion,
                tangent: improved.tangent,
                covariance: Some(improved.covariance),
                smooth: Some(improved.smooth),
                variance: improved.variance,
                ..plain
            },
            Some(improved) => Self { covariance: Some(nonlinearity_covariance(&minimum, &improved)), ..plain },
            None => plain,
        }
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

    /// Takes errors into the covariance that go together over a length, in the unit of the points.
    pub fn add_correlation(&mut self, inliers: &Observations, flow: &Flow<'_>, length: Option<f64>) {
        let (Some(covariance), Some(length)) = (self.covariance, length) else { return };
        let nu = self.weights(inliers);
        let at = Weighted { motion: &self.motion, tangent: &self.tangent, nu: &nu };
        self.covariance = correlated_covariance(&covariance, inliers, &at, flow, length);
    }

    /// What errors do that all flow has in common.
    pub fn systematic_effect(&self, inliers: &Observations, flow: &Flow<'_>, common: &CommonErrors) -> CommonEffect {
        let Some(covariance) = self.covariance else { return CommonEffect::default() };
        let nu = self.weights(inliers);
        let at = Weighted { motion: &self.motion, tangent: &self.tangent, nu: &nu };
        let moved = if common.offset > 0.0 { moved(inliers, &at) } else { Moved::zeros() };
        common.on(&covariance, &self.motion, inliers.prior.as_ref(), (&moved, &to_plane(flow.camera())))
    }

    /// Has in its covariance, multiplied by `wider`, what errors do that all flow has in common. Where the
    /// flow contradicts what is known beforehand of the rotation it reaches as far as the motion of the flow
    /// alone.
    pub fn inflate(&mut self, inliers: &Observations, wider: f64, common: CommonEffect) {
        self.common = common;
        let (Some(own), common) = (self.covariance, common.added()) else { return };
        let mut covariance = own * wider + common;
        if let Some(known) = &inliers.prior {
            let precision = if let Some(nu) = &self.smooth {
                information(inliers, &self.motion, &self.tangent, nu, 0.0)
            } else {
                let here = equations(inliers, &self.motion, &self.tangent, None);
                here.h - here.p
            };
            if let Some(apart) = contradiction(known, &self.motion.w(), &precision, (&own, wider, &common)) {
                covariance += apart * apart.transpose();
                self.undecided = Some(of_flow_alone(inliers, &self.motion));
            }
        }
        self.covariance = Some(covariance);
    }

    /// The depths in the weights, as long as the planes.
    fn weights(&self, inliers: &Observations) -> Cow<'_, [f64]> {
        let own = || Cow::Owned(depths(inliers, &self.motion).nu);
        self.smooth.as_deref().map_or_else(own, Cow::Borrowed)
    }
}

/// What one displacement of all flow does to a rotation alone, of this covariance.
pub(crate) fn rotation_shift(points: &Observations, covariance: &Matrix3<f64>) -> Matrix3x2<f64> {
    let mut sum = Matrix3x2::zeros();
    for k in (0..points.n).filter(|_| !points.spherical) {
        let row = points.row(k);
        sum += row.r.transpose() * row.g.fixed_columns::<2>(0);
    }
    covariance * sum
}

/// What one displacement of all flow does to the motion of points: `(sum W^t W)^-1 sum W_k^t p_k^t L_k^-1`,
/// `L_k^-1` whitening point `k`; what is known beforehand of the rotation is in `W^t W`. Nothing on the
/// sphere, where flow at different places has no common direction.
pub(crate) fn moved(inliers: &Observations, at: &Weighted<'_>) -> Moved {
    let mut sum = Moved::zeros();
    if inliers.spherical {
        return sum;
    }
    for k in 0..inliers.n {
        let g = inliers.row(k).g;
        let t = g * at.motion.u();
        let across = RowVector2::new(t.y, -t.x) / t.norm().max(f64::MIN_POSITIVE);
        // The first columns of `G` are those of the identity.
        sum += slopes(inliers, at.motion, at.tangent, at.nu[k], k) * (across * g.fixed_columns::<2>(0));
    }
    let precision = information(inliers, at.motion, at.tangent, at.nu, 0.0);
    inverse(&precision).map_or(Moved::zeros(), |inverse| inverse * sum)
}
