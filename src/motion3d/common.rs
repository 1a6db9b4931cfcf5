//! Errors that the flow of a whole picture has in common, which no residual tells.
//!
//! *One factor.* With `f`, depths and `w` times `1 + b` all residuals stay, and the direction is the same: a camera's rotation is off by `b w`. Flow from gradients errs like that: noise in the gradients makes it too short (J. Kearney, W. Thompson, D. Boley 1987; C. Fermueller, D. Shulman, Y. Aloimonos 2001), displacements that are not small beside the texture make it too long or too short, alike wherever the texture is.
//!
//! *One displacement.* What is alike all over a picture (its texture's scale, the displacement's fraction of a pixel between samples, the blur that is estimated with) makes flow err by the same vector, too. Most of that looks like a rotation.
//!
//! A field's covariance has both in it, as it has the whole error of a point, but no mean over points makes them smaller.

use super::covariance::{Matrix5, inverse};
use super::kernels::information;
use super::motion::Motion;
use super::observations::{Known, Observations, median};
use super::options::Flow;
use super::together::{Weighted, slopes};
use crate::error::{Error, Result};
use nalgebra::{Matrix2, RowVector2, SMatrix, SVector, Vector2};

/// The displacement's deviation in those of a point: in rendered rooms, by both methods with a field of windows, in much noise and in little, means of errors over a picture are 0.2 to 0.4 of it (`benchmarks/motion3d_fields.py --errors`).
const SHARE: f64 = 0.4;

/// What one displacement of all flow, on the plane at distance 1, does to the equations' unknowns.
pub(super) type Moved = SMatrix<f64, 5, 2>;

/// Standard deviations of errors that all flow of a picture has in common. Default: 0.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CommonErrors {
    /// Of a factor, about 1, that all flow is too long by: no residual tells it, and it is one of the rotation's length.
    pub scale: f64,
    /// Of each component of one displacement, in the unit of the flow: most of it looks like a rotation. Not on the sphere.
    pub offset: f64,
}

impl CommonErrors {
    /// As far as covariances tell. The factor: by what would be the whole error of half the points. Of each point, its flow and the covariance of that.
    pub(super) fn told(points: impl Iterator<Item = (Vector2<f64>, Matrix2<f64>)>) -> Self {
        let (mut squares, mut variances) = (Vec::new(), Vec::new());
        for (flow, covariance) in points {
            let square = covariance.cholesky().map(|factor| flow.dot(&factor.solve(&flow)));
            if let Some(square) = square.filter(|square| square.is_finite()) {
                squares.push(square);
                variances.push(0.5 * covariance.trace());
            }
        }
        let median_square = median(&mut squares);
        // An error has two components. Flow that may be twice as long or none has no scale.
        let scale = if median_square > 0.0 { (2.0 / median_square).sqrt().min(1.0) } else { 1.0 };
        Self { scale, offset: SHARE * median(&mut variances).sqrt() }
    }

    pub(super) fn check(&self, flow: &Flow<'_>) -> Result<()> {
        for (name, deviation) in [("flow_scale", self.scale), ("flow_offset", self.offset)] {
            if !(deviation.is_finite() && deviation >= 0.0) {
                return Err(Error::argument(name, "a number of at least 0", deviation));
            }
        }
        if matches!(flow, Flow::Sphere { .. }) && self.offset > 0.0 {
            return Err(Error::argument(
                "flow_offset",
                "0 on the sphere, where no displacement is common",
                self.offset,
            ));
        }
        Ok(())
    }

    /// What both add to the covariance of a motion; `moved`: what a displacement of 1 in the flow's unit does to it. Less what is known beforehand of the rotation.
    pub(super) fn added(&self, covariance: &Matrix5, motion: &Motion, known: Option<&Known>, moved: &Moved) -> Matrix5 {
        let w = motion.w();
        let mut scaled = SVector::<f64, 5>::new(0.0, 0.0, w.x, w.y, w.z);
        if let Some(known) = known {
            scaled -= covariance.fixed_columns::<3>(2) * (known.information * w);
        }
        scaled * scaled.transpose() * self.scale.powi(2) + moved * moved.transpose() * self.offset.powi(2)
    }
}

/// What one displacement of all flow does to the motion of points: `(sum W^t W)^-1 sum W_k^t p_k^t L_k^-1`, `L_k^-1` whitening point `k`, with what is known beforehand of the rotation. Nothing on the sphere, where flow at different places has no common direction.
pub(super) fn moved(inliers: &Observations, at: &Weighted<'_>) -> Moved {
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
    let mut told = information(inliers, at.motion, at.tangent, at.nu, 0.0);
    if let Some(known) = &inliers.prior {
        let mut rotation = told.fixed_view_mut::<3, 3>(2, 2);
        rotation += known.information;
    }
    inverse(&told).map_or(Moved::zeros(), |inverse| inverse * sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_are_told_by_the_usual_point() {
        let point = |length: f64| (Vector2::new(length, 0.0), Matrix2::identity() * 0.04);
        let common = CommonErrors::told([1.0, 4.0, 9.0].into_iter().map(point));
        // A flow of 20 deviations, and one point's of 0.2.
        assert!((common.scale - (2.0f64 / 400.0).sqrt()).abs() < 1e-12, "{common:?}");
        assert!((common.offset - SHARE * 0.2).abs() < 1e-12, "{common:?}");
        assert_eq!(CommonErrors::told(std::iter::empty()).scale, 1.0);
    }
}
