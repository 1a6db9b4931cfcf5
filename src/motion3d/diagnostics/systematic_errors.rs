//! Errors that the flow of a whole picture has in common, which no residual tells.
//!
//! *One factor.* With `f`, depths and `w` times `1 + b` all residuals stay, and the direction is the same: a
//! camera's rotation is off by `b w`. Flow from gradients errs like that: noise in the gradients makes it too
//! short (J. Kearney, W. Thompson, D. Boley 1987; C. Fermueller, D. Shulman, Y. Aloimonos 2001),
//! displacements that are not small beside the texture make it too long or too short, alike wherever the
//! texture is.
//!
//! *One displacement.* What is alike all over a picture (its texture's scale, the displacement's fraction of
//! a pixel between samples, the blur that is estimated with) makes flow err by the same vector, too. Most of
//! that looks like a rotation.
//!
//! A field's covariance has both in it, as it has the whole error of a point, but no mean over points makes
//! them smaller.

use super::correlated_noise::{Weighted, slopes};
use super::rotation_prior::Known;
use crate::error::{Error, Result};
use crate::math::Real;
use crate::math::{median, quantile};
use crate::motion3d::kernels::information;
use crate::motion3d::model::motion::{Motion, Projection};
use crate::motion3d::model::observations::Observations;
use crate::motion3d::solver::covariance::{Matrix5, inverse};
use crate::types::{FlowField, Status};
use nalgebra::{Matrix2, Matrix3, Matrix3x2, RowVector2, SMatrix, SVector, Vector2, Vector3};

/// The displacement's deviation in those of a point: in rendered rooms, by both methods with a field of
/// windows, in much noise and in little, means of errors over a picture are 0.2 to 0.4 of it
/// (`benchmarks/tables/motion3d_fields.py --only errors`).
const SHARE: f64 = 0.4;

/// The share of the points whose errors tell how far the factor is off: others have covariances for lack of
/// texture.
const BEST: f64 = 0.25;

/// About so many sites of a field are asked.
const ENOUGH: f64 = 4000.0;

/// The largest displacement: squares of larger ones are no numbers.
const FARTHEST: f64 = 1e100;

/// What one displacement of all flow, on the plane at distance 1, does to the equations' unknowns.
pub(crate) type Moved = SMatrix<f64, 5, 2>;

/// Standard deviations of errors that all flow of a picture has in common. Default: 0.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CommonErrors {
    /// Of a factor, about 1, that all flow is too long by: no residual tells it, and it is one of the
    /// rotation's length.
    pub scale: f64,
    /// Of each component of one displacement, in the unit of the flow: most of it looks like a rotation. Not
    /// on the sphere.
    pub offset: f64,
}

/// What they do to a motion: its covariance has the squares of `motion` in it. Default: nothing.
///
/// Whatever is computed from the same flow and the motion together, as depths are, errs with both.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CommonEffect {
    /// Standard deviation of the factor.
    pub scale: f64,
    /// Displacements of one deviation along both axes of the picture, on the plane at distance 1.
    pub displaced: [[f64; 2]; 2],
    /// What one deviation of the factor and each of these displacements do to `(psi, w)`, rad and rad/frame.
    pub motion: [[f64; 5]; 3],
}

impl CommonEffect {
    fn of(scale: f64, scaled: &SVector<f64, 5>, displaced: &Matrix2<f64>, moved: &Moved) -> Self {
        let column = |k: usize| moved.column(k).into_owned().into();
        let displacement = |k: usize| displaced.column(k).into_owned().into();
        Self {
            scale,
            displaced: [displacement(0), displacement(1)],
            motion: [(scaled * scale).into(), column(0), column(1)],
        }
    }

    /// What displacements of one deviation do to the motion.
    fn moves(&self) -> [SVector<f64, 5>; 3] {
        self.motion.map(SVector::from)
    }

    /// What is in the motion's covariance.
    pub(crate) fn added(&self) -> Matrix5 {
        self.moves().iter().map(|moved| moved * moved.transpose()).sum()
    }

    /// The variance of a value that is `value` times as large with all flow, by its slopes along `(psi, w)`
    /// and along a point's own flow on the plane at distance 1.
    pub(crate) fn variance(&self, value: f64, of_motion: &SVector<f64, 5>, of_flow: &RowVector2<f64>) -> f64 {
        let [_, along @ ..] = self.moves();
        let displaced = along.iter().zip(self.displaced.map(Vector2::from));
        let moved = displaced.map(|(moved, by)| (of_motion.dot(moved) + (of_flow * by)[0]).powi(2));
        (value * self.scale).powi(2) + moved.sum::<f64>()
    }
}

impl CommonErrors {
    /// As far as covariances tell. The factor: by what would be the whole error of the points that tell it
    /// best. Of each point, its flow and the covariance of that.
    fn told(points: impl Iterator<Item = (Vector2<f64>, Matrix2<f64>)>) -> Self {
        let (mut squares, mut variances) = (Vec::new(), Vec::new());
        for (flow, covariance) in points {
            let square = covariance.cholesky().map(|factor| flow.dot(&factor.solve(&flow)));
            if let Some(square) = square.filter(|square| square.is_finite()) {
                squares.push(square);
                variances.push(0.5 * covariance.trace());
            }
        }
        let square = quantile(&mut squares, 1.0 - BEST).unwrap_or(0.0);
        // An error has two components. Flow that may be twice as long or none has no scale.
        let scale = if square > 0.0 { (2.0 / square).sqrt().min(1.0) } else { 1.0 };
        Self { scale, offset: SHARE * median(&mut variances).unwrap_or(0.0).sqrt() }
    }

    /// Those of a field, whatever part of it is looked at: a thing that hardly moves in the picture does not
    /// tell by how large a factor flow is off.
    pub(crate) fn of_field<T: Real>(field: &FlowField<T>) -> Self {
        let step = ((field.len() as f64 / ENOUGH).sqrt() as usize).max(1);
        let sites = (0..field.height)
            .step_by(step)
            .flat_map(|row| (0..field.width).step_by(step).map(move |column| row * field.width + column));
        let told = |site: usize| {
            let valid = field.status[site].is_valid() && field.status[site] != Status::Inconsistent;
            let covariance = field.covariance_at(site).filter(|_| valid)?;
            let [u, v, ..] = field.affine(site).to_array().map(Real::to_f64);
            Some((Vector2::new(u, v), Matrix2::from_fn(|i, j| covariance[i][j])))
        };
        Self::told(sites.filter_map(told))
    }

    /// On the plane or the sphere.
    pub(crate) fn check(&self, projection: Projection) -> Result<()> {
        if !(0.0..=1.0).contains(&self.scale) {
            return Err(Error::argument("flow_scale", "a number from 0 to 1", self.scale));
        }
        if !(0.0..=FARTHEST).contains(&self.offset) {
            return Err(Error::argument("flow_offset", format!("a number from 0 to {FARTHEST:e}"), self.offset));
        }
        if projection == Projection::Sphere && self.offset > 0.0 {
            return Err(Error::argument(
                "flow_offset",
                "0 on the sphere, where no displacement is common",
                self.offset,
            ));
        }
        Ok(())
    }

    /// What both do to a motion of this covariance; `moved`: what displacements on the plane at distance 1 do
    /// to it, to which `unit` maps flow. Less what is known beforehand of the rotation.
    pub(crate) fn on(
        &self,
        covariance: &Matrix5,
        motion: &Motion,
        known: Option<&Known>,
        (moved, unit): (&Moved, &Matrix2<f64>),
    ) -> CommonEffect {
        let w = motion.w();
        let mut scaled = SVector::<f64, 5>::new(0.0, 0.0, w.x, w.y, w.z);
        if let Some(known) = known {
            scaled -= covariance.fixed_columns::<3>(2) * (known.information * w);
        }
        let displaced = unit * self.offset;
        CommonEffect::of(self.scale, &scaled, &displaced, &(moved * displaced))
    }

    /// What both add to the covariance of a rotation alone; `moved`: what displacements in the unit of the
    /// flow do to it.
    pub(crate) fn added_to_rotation(&self, w: &Vector3<f64>, moved: &Matrix3x2<f64>) -> Matrix3<f64> {
        w * w.transpose() * self.scale.powi(2) + moved * moved.transpose() * self.offset.powi(2)
    }
}

/// What one displacement of all flow does to a rotation alone, of this covariance.
pub(crate) fn turned(points: &Observations, covariance: &Matrix3<f64>) -> Matrix3x2<f64> {
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
    let told = information(inliers, at.motion, at.tangent, at.nu, 0.0);
    inverse(&told).map_or(Moved::zeros(), |inverse| inverse * sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_are_told_by_points() {
        let point = |length: f64| (Vector2::new(length, 0.0), Matrix2::identity() * 0.04);
        let common = CommonErrors::told([1.0, 4.0, 9.0].into_iter().map(point));
        // A flow of 45 deviations, and one point's of 0.2.
        assert!((common.scale - (2.0f64 / 2025.0).sqrt()).abs() < 1e-12, "{common:?}");
        assert!((common.offset - SHARE * 0.2).abs() < 1e-12, "{common:?}");
        assert_eq!(CommonErrors::told(std::iter::empty()).scale, 1.0);
    }
}
