//! Covariances of a motion: maximum likelihood's and the bound.

use crate::motion3d::kernels::{Weighted, information};
use crate::motion3d::model::{observations::Observations, rows::Matrix5};
use nalgebra::{Matrix2, SymmetricEigen};

/// Least eigenvalue of the information without the depths' noise, relative to that with it, that is still
/// known to be positive.
const MIN_INFORMATION_RATIO: f64 = 1e-3;

/// Least eigenvalue of an information in units of its own diagonal, below which it may be rounding; a field
/// of half a degree leaves a million times as much.
pub(crate) const DETERMINED: f64 = 1e-12;

/// The 0.95 quantile of chi-squared with five degrees of freedom.
pub(crate) const PLAUSIBLE: f64 = 11.07;

/// What the data say about the covariance of maximum likelihood and the bound.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PluginCovariances {
    /// (17): `M^-1 H M^-1` with `M = H - P`.
    pub likelihood: Matrix5,
    /// `M^-1`.
    pub bound: Matrix5,
}

/// A symmetric positive definite matrix's inverse.
pub(crate) fn inverse(matrix: &Matrix5) -> Option<Matrix5> {
    let inverse = matrix.cholesky()?.inverse();
    inverse.iter().all(|value| value.is_finite()).then_some(inverse)
}

/// The inverse of an information that determines all five numbers; `None` where rounding alone keeps it
/// positive definite, as that of fewer points than a motion takes, or of all in two places.
pub(crate) fn determined(information: &Matrix5) -> Option<Matrix5> {
    let units = Matrix5::from_diagonal(&information.diagonal().map(|own| 1.0 / own.sqrt()));
    let unitless = units * information * units;
    let finite = unitless.iter().all(|value| value.is_finite());
    let least = if finite { SymmetricEigen::new(unitless).eigenvalues.min() } else { 0.0 };
    if least > DETERMINED { inverse(information) } else { None }
}

/// The covariances by `H` and the noise `P` of its depths at a minimum; `None` where noise makes up nearly
/// all of the information.
///
/// `E[H] = M + P`: noisy depths add to the products that the information is made of, so that the usual `H^-1`
/// lies below the bound.
pub(crate) fn plugged(h: &Matrix5, p: &Matrix5) -> Option<PluginCovariances> {
    let factor = h.cholesky()?.l();
    let whiten = factor.try_inverse()?;
    let noise = whiten * p * whiten.transpose();
    let most = SymmetricEigen::new(noise).eigenvalues.max();
    // Not a number is not enough either.
    let enough = 1.0 - most >= MIN_INFORMATION_RATIO;
    if !enough {
        return None;
    }
    let bound = inverse(&(h - p))?;
    let likelihood = bound * h * bound;
    Some(PluginCovariances { likelihood: likelihood.symmetric_part(), bound })
}

/// The 2 x 2 block of the direction.
pub(crate) fn direction_block(covariance: &Matrix5) -> Matrix2<f64> {
    covariance.fixed_view::<2, 2>(0, 0).into_owned()
}

/// Standard deviation of the direction, `sqrt(tr psi)`, degrees.
pub(crate) fn direction_deviation(covariance: &Matrix5) -> f64 {
    direction_block(covariance).trace().max(0.0).sqrt().to_degrees()
}

/// `kappa^2`, the larger variance of the direction: within that of the epipole weights are damped.
pub(crate) fn damping(observations: &Observations, at: &Weighted<'_>) -> Option<f64> {
    let covariance = inverse(&information(observations, at, 0.0))?;
    Some(SymmetricEigen::new(direction_block(&covariance)).eigenvalues.max())
}
