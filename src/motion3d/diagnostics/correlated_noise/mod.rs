//! What errors that go together over some distance do to a covariance.
//!
//! Sums over points that are taken for independent make the covariance too small where neighbours err alike.
//! With the correlation `rho(d)` of two errors at the distance `d`, the equations `sum W^t e` have the
//! covariance `sum_kl rho(d_kl) W_k^t W_l` instead of `sum W^t W`: neighbours count by how much their rows
//! agree, so that points which decide alone change little. How far errors correlate beyond the given length,
//! and how large they are, is estimated from the residuals ([`Errors`]).

mod errors;

use crate::motion3d::kernels::information;
use crate::motion3d::model::input::Flow;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::rows::Matrix5;
use crate::motion3d::solver::covariance::inverse;
use errors::{Errors, Neighbourhood};
use nalgebra::{Matrix2x3, Matrix3, SymmetricEigen, Vector3};

/// What was measured on the residuals of windowed flow of a drive: this share falls off as fast as windows
/// stop sharing pixels, the rest over so many correlation lengths.
const QUICK: f64 = 0.4;
const TAIL: f64 = 3.75;

/// Correlation lengths at which what is left, one hundredth, no longer counts.
const REACH: f64 = 15.0;

/// Correlation of the errors of windowed flow at a distance, in correlation lengths: `0.4 exp(-d^2 / 4) + 0.6
/// exp(-d / 3.75)`.
fn correlation(distance: f64) -> f64 {
    QUICK * (-0.25 * distance * distance).exp() + (1.0 - QUICK) * (-distance / TAIL).exp()
}

/// The area over which errors are one, `int rho`, in squared correlation lengths: sums over larger areas err
/// as if so much of it were one point.
pub(crate) fn area() -> f64 {
    std::f64::consts::PI * (4.0 * QUICK + 2.0 * (1.0 - QUICK) * TAIL * TAIL)
}

/// A motion whose equations have these depths in their weights.
pub(crate) struct Weighted<'a> {
    pub motion: &'a Motion,
    pub tangent: &'a Matrix2x3<f64>,
    /// As long as the planes.
    pub nu: &'a [f64],
}

/// The covariance where errors go together over `length`, in the unit of the points: in no direction smaller
/// than `covariance`, which takes the points for independent.
///
/// From `covariance = X B X` with `B = sum W^t W` follows the `X` that the equations' errors are multiplied
/// with: the geometric mean of the covariance and `B^-1`.
pub(crate) fn correlated_covariance(
    covariance: &Matrix5,
    inliers: &Observations,
    at: &Weighted<'_>,
    flow: &Flow<'_>,
    length: f64,
) -> Option<Matrix5> {
    let squares = information(inliers, at.motion, at.tangent, at.nu, 0.0);
    let points = Neighbourhood::new(inliers, at, flow, length);
    let errors = Errors::from_residuals(&points, &inverse(&squares)?, inliers.own());
    let l = squares.cholesky()?.l();
    let back = l.try_inverse()?;
    let larger = Matrix5::identity() + positive(&(back * correlation_excess(&points, &errors) * back.transpose()));
    let normalised = l.transpose() * covariance * l;
    let normalised = SymmetricEigen::new(0.5 * (normalised + normalised.transpose()));
    let root = normalised.eigenvalues.map(|size| size.max(0.0).sqrt());
    let root = normalised.eigenvectors * Matrix5::from_diagonal(&root) * normalised.eigenvectors.transpose();
    let out = back.transpose() * root * larger * root * back;
    let out = 0.5 * (out + out.transpose());
    inverse(&out).map(|_| out)
}

/// The same of a rotation alone, whose residuals are flow of two components.
pub(crate) fn correlated_rotation_covariance(
    covariance: &Matrix3<f64>,
    inliers: &Observations,
    w: &Vector3<f64>,
    flow: &Flow<'_>,
    length: f64,
) -> Matrix3<f64> {
    let mut inverse = Matrix5::zeros();
    inverse.fixed_view_mut::<3, 3>(2, 2).copy_from(covariance);
    let of_axis = |axis: usize| {
        let points = Neighbourhood::of_rotation(inliers, w, axis, flow, length);
        correlation_excess(&points, &Errors::from_residuals(&points, &inverse, inliers.own()))
    };
    inverse += inverse * positive(&(of_axis(0) + of_axis(1))) * inverse;
    inverse.fixed_view::<3, 3>(2, 2).into_owned()
}

/// The part of a symmetric matrix above 0: below, the points would have more information than independent
/// ones.
fn positive(matrix: &Matrix5) -> Matrix5 {
    let eigen = SymmetricEigen::new(0.5 * (matrix + matrix.transpose()));
    let sizes = eigen.eigenvalues.map(|size| size.max(0.0));
    eigen.eigenvectors * Matrix5::from_diagonal(&sizes) * eigen.eigenvectors.transpose()
}

/// What correlation adds to `sum W^t W`: the products of different points, less what the given noise
/// has too much for each point's own where several share one error.
fn correlation_excess(points: &Neighbourhood, errors: &Errors) -> Matrix5 {
    points.different(errors.stretch) * errors.variance + points.squares() * (errors.variance - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_go_together_less_with_distance() {
        assert_eq!(correlation(0.0), 1.0);
        let values: Vec<f64> = (0..16).map(|d| correlation(f64::from(d))).collect();
        assert!(values.windows(2).all(|pair| pair[1] < pair[0]), "{values:?}");
        // At four correlation lengths a fifth is left, at fifteen one hundredth.
        assert!((0.15..0.25).contains(&values[4]) && values[15] < 0.012, "{values:?}");
    }
}
