//! What is believed before any point is seen.

use super::{options::CovariancePrior, options::MixtureOptions, points::LARGEST, points::Points};
use crate::error::{Error, Result};
use crate::math::dense;

/// Added to the default of the degrees of freedom, over D.
const FREEDOM: f64 = 9.1;
/// Pivots of the data's correlations below this are none: points in a plane.
const FLAT: f64 = 1e-10;
/// What the diagonal of such a covariance is raised by, relative to itself; along an axis without spread,
/// relative to its mean, or absolutely where no axis has any.
const RAISED: f64 = 1e-6;
/// Variances up to this are no spread: their inverses would be near overflow.
const MIN_VARIANCE: f64 = 1e-304;

/// The prior: `pi ~ Dir(alpha0)` (8), `mu_k ~ N(m0, (beta0 Lambda_k)^-1)`, `Lambda_k ~ W(W0, nu0)` (9).
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// `alpha0`.
    pub weight_concentration: f64,
    /// `beta0`.
    pub mean_precision: f64,
    /// `m0` (D).
    pub mean: Vec<f64>,
    /// `nu0`.
    pub degrees_of_freedom: f64,
    /// `W0^-1` (D, D), row-major.
    pub scale_inverse: Vec<f64>,
}

impl Prior {
    /// What the options say, and where they leave it open, what the points do.
    ///
    /// # Errors
    /// [`Error::Argument`] naming a prior of the wrong size or without a density.
    pub fn resolve(options: &MixtureOptions, points: &Points) -> Result<Self> {
        let dimensions = points.dimensions;
        let this = Self {
            weight_concentration: options.weight_concentration_prior,
            mean_precision: options.mean_precision_prior,
            mean: options.mean_prior.clone().unwrap_or_else(|| points.mean()),
            degrees_of_freedom: options.degrees_of_freedom_prior.unwrap_or(dimensions as f64 + FREEDOM),
            scale_inverse: match &options.covariance_prior {
                CovariancePrior::Data => data_covariance(points),
                CovariancePrior::Isotropic(variance) => scaled_identity(dimensions, *variance),
                CovariancePrior::Full(matrix) => matrix.clone(),
            },
        };
        this.check(dimensions, "degrees_of_freedom_prior")?;
        Ok(this)
    }

    /// `freedom`: how the caller calls the degrees of freedom.
    pub(super) fn check(&self, dimensions: usize, freedom: &'static str) -> Result<()> {
        if self.mean.len() != dimensions || self.mean.iter().any(|m| !m.is_finite() || m.abs() > LARGEST) {
            let got = format!("{:?}", self.mean);
            return Err(Error::argument("mean_prior", format!("{dimensions} finite numbers up to {LARGEST:e}"), got));
        }
        let least = dimensions as f64 - 1.0;
        if !(self.degrees_of_freedom.is_finite() && self.degrees_of_freedom > least) {
            let expected = format!("a finite number above {least}");
            return Err(Error::argument(freedom, expected, self.degrees_of_freedom));
        }
        let expected = format!("a symmetric positive definite matrix ({dimensions}, {dimensions})");
        if self.scale_inverse.len() != dimensions * dimensions {
            let got = format!("{} numbers", self.scale_inverse.len());
            return Err(Error::argument("covariance_prior", expected, got));
        }
        if let Some(fault) = dense::covariance_fault(&self.scale_inverse, dimensions) {
            return Err(Error::argument("covariance_prior", expected, fault));
        }
        let mut factor = vec![0.0; dimensions * dimensions];
        if !dense::cholesky(&self.scale_inverse, dimensions, &mut factor) {
            return Err(Error::argument("covariance_prior", expected, "one that is singular"));
        }
        Ok(())
    }
}

pub(super) fn scaled_identity(n: usize, value: f64) -> Vec<f64> {
    (0..n * n).map(|at| if at % (n + 1) == 0 { value } else { 0.0 }).collect()
}

/// Weighted covariance of the points, over the sum of the weights less one, so that weights are repetitions,
/// or over half of that sum where that is more: below 2 there is nothing to repeat, and the prior must not
/// jump where the weights pass it. Raised where the points lie in a plane.
pub(super) fn data_covariance(points: &Points) -> Vec<f64> {
    let d = points.dimensions;
    let mean = points.mean();
    let mut sums = vec![0.0; d * d];
    let mut total = 0.0;
    for n in 0..points.count() {
        let (x, weight) = (points.at(n), points.weight(n));
        total += weight;
        for i in 0..d {
            for j in 0..=i {
                sums[i * d + j] += weight * (x[i] - mean[i]) * (x[j] - mean[j]);
            }
        }
    }
    let over = (total - 1.0).max(0.5 * total);
    for i in 0..d {
        for j in 0..=i {
            sums[i * d + j] /= over;
            sums[j * d + i] = sums[i * d + j];
        }
    }
    let spread: Vec<bool> = (0..d).map(|i| sums[i * (d + 1)] > MIN_VARIANCE).collect();
    raise_where_none(&mut sums, &spread);
    raise_if_flat(&mut sums, d);
    sums
}

/// Gives axes without `spread` a small variance of their own, and no correlations.
fn raise_where_none(matrix: &mut [f64], spread: &[bool]) {
    let d = spread.len();
    let typical = (0..d).filter(|i| spread[*i]).map(|i| matrix[i * (d + 1)]).sum::<f64>() / d as f64;
    for i in (0..d).filter(|i| !spread[*i]) {
        for j in 0..d {
            matrix[i * d + j] = 0.0;
            matrix[j * d + i] = 0.0;
        }
        matrix[i * (d + 1)] = if typical > 0.0 { (RAISED * typical).max(MIN_VARIANCE) } else { RAISED };
    }
}

/// Adds to the diagonal of a covariance that has no, or nearly no, extent in some direction. Correlations
/// decide, so that the axes' units make no difference.
fn raise_if_flat(matrix: &mut [f64], d: usize) {
    let deviations: Vec<f64> = (0..d).map(|i| matrix[i * (d + 1)].sqrt()).collect();
    let correlations: Vec<f64> = (0..d * d).map(|at| matrix[at] / deviations[at / d] / deviations[at % d]).collect();
    let mut factor = vec![0.0; d * d];
    let exists = dense::cholesky(&correlations, d, &mut factor);
    let pivots = (0..d).map(|i| factor[i * (d + 1)].powi(2));
    if exists && pivots.fold(f64::INFINITY, f64::min) > FLAT {
        return;
    }
    (0..d).for_each(|i| matrix[i * (d + 1)] *= 1.0 + RAISED);
}
