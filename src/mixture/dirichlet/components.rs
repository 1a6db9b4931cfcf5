//! The M step: Gaussians with proportions from the moments of the points.

use super::{options::DirichletOptions, options::Inference, options::add_to_diagonal, sticks};
use crate::error::Result;
use crate::math::special::digamma;
use crate::mixture::densities::{Densities, Factors};
use crate::mixture::moments::Moments;
use crate::mixture::posterior::Posterior;
use crate::mixture::prior::Prior;
use std::f64::consts::LN_2;

/// What the E step evaluates: `rho_k(x) = exp(log_factor_k) N(x; mean_k, covariance_k)`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Components {
    /// `ln pi_k` (K), and with [`Inference::Vb`] what expectation adds to it. Negative infinity: no share of
    /// any point.
    pub log_factors: Vec<f64>,
    /// (K, D).
    pub means: Vec<f64>,
    /// (K, D, D).
    pub covariances: Vec<f64>,
}

impl Components {
    /// The M step from moments in the order of decreasing weight.
    pub fn maximised(prior: &Prior, options: &DirichletOptions, moments: &Moments) -> Self {
        let d = moments.dimensions;
        let alpha = options.weight_concentration;
        let posterior = Posterior::maximised(prior, moments);
        let mut log_factors = sticks::log_proportions(&moments.counts, alpha, options.inference);
        let mut covariances = posterior.scale_inverses;
        for (k, matrix) in covariances.chunks_exact_mut(d * d).enumerate() {
            let nu = posterior.degrees_of_freedom[k];
            let over = match options.inference {
                Inference::Map => nu + d as f64 + 2.0,
                Inference::Vb => nu,
            };
            for value in matrix.iter_mut() {
                *value /= over;
            }
            if options.inference == Inference::Vb {
                log_factors[k] += expectation(d, nu, posterior.mean_precision[k]);
            }
        }
        add_to_diagonal(&mut covariances, d, options.covariance_floor);
        Self { log_factors, means: posterior.means, covariances }
    }

    /// K.
    pub fn count(&self) -> usize {
        self.log_factors.len()
    }

    /// The components with a share, and their densities.
    ///
    /// # Errors
    /// [`Error::Numerical`](crate::Error::Numerical) for a covariance that is not positive definite.
    pub fn densities(&self) -> Result<(Vec<usize>, Densities)> {
        let d = self.means.len() / self.count();
        let used: Vec<usize> = (0..self.count()).filter(|k| self.log_factors[*k] > f64::NEG_INFINITY).collect();
        let rows = |values: &[f64], length: usize| -> Vec<f64> {
            used.iter().flat_map(|k| &values[k * length..(k + 1) * length]).copied().collect()
        };
        let factors = Factors::of_matrices(&rows(&self.covariances, d * d), d)?;
        let densities = Densities::gaussian(&rows(&self.log_factors, 1), &rows(&self.means, d), &factors);
        Ok((used, densities))
    }
}

/// `E ln N(x; mu, Lambda^-1) - ln N(x; E mu, (E Lambda)^-1)` under a Gauss-Wishart posterior:
/// `1/2 sum_(i=1..D) psi((nu + 1 - i) / 2) + D/2 ln 2 - D/2 ln nu - D / (2 kappa)`.
fn expectation(d: usize, nu: f64, kappa: f64) -> f64 {
    let gammas: f64 = (0..d).map(|i| digamma(0.5 * (nu - i as f64))).sum();
    0.5 * (gammas + d as f64 * (LN_2 - nu.ln() - 1.0 / kappa))
}
