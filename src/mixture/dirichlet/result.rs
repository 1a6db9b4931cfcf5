//! A fitted mixture, and what it says of points.

use crate::error::{Error, Result};
use crate::mixture::densities::{Densities, Factors};
use crate::mixture::points::Points;

/// Share of all points above which a component counts as active: 0.5 %.
const ACTIVE_SHARE: f64 = 0.005;

/// A fitted mixture: K components in D dimensions, in the order of decreasing weight.
#[derive(Debug, Clone, PartialEq)]
pub struct DirichletMixture {
    /// D.
    pub dimensions: usize,
    /// Proportions `pi_k` (K), which sum to 1.
    pub weights: Vec<f64>,
    /// Logarithm of the factor before each Gaussian in the E step (K): `ln pi_k`, or of variational Bayes
    /// `E ln pi_k + 1/2 sum_(i=1..D) psi((nu_k + 1 - i) / 2) + D/2 ln (2 / nu_k) - D / (2 kappa_k)`.
    /// Negative infinity: an empty component.
    pub log_factors: Vec<f64>,
    /// `mu_k` (K, D), in units of the points.
    pub means: Vec<f64>,
    /// `Sigma_k` (K, D, D), in squared units of the points.
    pub covariances: Vec<f64>,
    /// `N_k` (K), weight of the points that the last M step was made from.
    pub counts: Vec<f64>,
    /// F, the log evidence of the last responsibilities (natural logarithm).
    pub lower_bound: f64,
    /// Number of rounds that led here.
    pub n_iter: usize,
    /// Whether the last rounds ended by `tol`.
    pub converged: bool,
}

impl DirichletMixture {
    /// K.
    pub fn components(&self) -> usize {
        self.weights.len()
    }

    /// Number of components with more than 0.5 % of the weight of all points.
    pub fn n_active(&self) -> usize {
        let total: f64 = self.counts.iter().sum();
        self.counts.iter().filter(|count| **count > ACTIVE_SHARE * total).count()
    }

    /// `ln sum_k rho_nk` of points (N), natural logarithm, and the responsibilities (N, K), row-major, whose
    /// rows sum to 1. With `rho_nk = exp(log_factor_k) N(x_n; mu_k, Sigma_k)` the former is the log density
    /// of the mixture or, of variational Bayes, a lower bound of it.
    ///
    /// # Errors
    /// [`Error::Argument`] for points (`X`) that are not finite or of another dimension.
    pub fn log_densities(&self, points: &Points) -> Result<(Vec<f64>, Vec<f64>)> {
        points.check_values()?;
        let d = self.dimensions;
        if points.dimensions != d {
            return Err(Error::argument("X", format!("points in {d} dimensions"), points.dimensions));
        }
        let factors = Factors::of_matrices(&self.covariances, d)?;
        Ok(Densities::gaussian(&self.log_factors, &self.means, &factors).log_densities(points))
    }
}
