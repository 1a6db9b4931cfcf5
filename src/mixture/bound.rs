//! The lower bound of the evidence, which every round raises.

use super::{densities::Factors, posterior::Posterior, prior::Prior};
use crate::error::Result;
use crate::math::special::ln_gamma;
use std::f64::consts::{LN_2, PI, TAU};

/// `ln B(W, nu)` of a Wishart density, from `ln |W^-1|`.
fn log_wishart(log_determinant_of_inverse: f64, nu: f64, d: usize) -> f64 {
    let dimensions = d as f64;
    let gammas: f64 = (0..d).map(|i| ln_gamma((nu - i as f64) / 2.0)).sum();
    let constant = 0.5 * nu * dimensions * LN_2 + 0.25 * dimensions * (dimensions - 1.0) * PI.ln();
    0.5 * nu * log_determinant_of_inverse - constant - gammas
}

/// `ln C(alpha)` of a Dirichlet density.
fn log_dirichlet(alpha: &[f64]) -> f64 {
    ln_gamma(alpha.iter().sum()) - alpha.iter().map(|a| ln_gamma(*a)).sum::<f64>()
}

/// What the bound has of the prior alone, for one component: constant while a fit lasts.
#[derive(Debug)]
pub(super) struct PriorTerms {
    log_wishart: f64,
}

impl PriorTerms {
    /// # Errors
    /// [`Error::Numerical`](crate::Error::Numerical) for a matrix without a factor.
    pub fn of(prior: &Prior) -> Result<Self> {
        let d = prior.mean.len();
        let alone = Posterior {
            dimensions: d,
            weight_concentration: vec![prior.weight_concentration],
            mean_precision: vec![prior.mean_precision],
            degrees_of_freedom: vec![prior.degrees_of_freedom],
            means: prior.mean.clone(),
            scale_inverses: prior.scale_inverse.clone(),
        };
        let determinant = Factors::of(&alone)?.log_determinants[0];
        Ok(Self { log_wishart: log_wishart(determinant, prior.degrees_of_freedom, d) })
    }
}

/// The lower bound after an M step from responsibilities r: `sum_n f_n sum_k r_nk ln r_nk` is `negentropy`,
/// `sum_n f_n` is `total`.
///
/// `L = -negentropy + ln C(alpha0) - ln C(alpha) + sum_k [ln B(W0, nu0) - ln B(W_k, nu_k) + D / 2 ln (beta0 /
/// beta_k)] - D F / 2 ln 2 pi`: all expectations of the complete data cancel against the M step's, which
/// leaves normalising constants.
pub(super) fn lower_bound(
    prior: &Prior,
    terms: &PriorTerms,
    posterior: &Posterior,
    factors: &Factors,
    (negentropy, total): (f64, f64),
) -> f64 {
    let concentration = log_dirichlet(&vec![prior.weight_concentration; posterior.components()]);
    let sum = -negentropy + concentration - log_dirichlet(&posterior.weight_concentration);
    with_gaussians(sum, prior, terms, posterior, factors) - gaussian_constant(posterior.dimensions, total)
}

/// `sum` and what the bound has of every Gaussian: `ln B(W0, nu0) - ln B(W_k, nu_k) + D / 2 ln (beta0 /
/// beta_k)`. Less [`gaussian_constant`] that is the log evidence of the points, as they are divided among the
/// components.
pub(super) fn with_gaussians(
    mut sum: f64,
    prior: &Prior,
    terms: &PriorTerms,
    posterior: &Posterior,
    factors: &Factors,
) -> f64 {
    let d = posterior.dimensions;
    for k in 0..posterior.components() {
        let own = log_wishart(factors.log_determinants[k], posterior.degrees_of_freedom[k], d);
        let precision = 0.5 * d as f64 * (prior.mean_precision / posterior.mean_precision[k]).ln();
        sum += terms.log_wishart - own + precision;
    }
    sum
}

/// `D F / 2 ln 2 pi`, F the weight of all points.
pub(super) fn gaussian_constant(d: usize, total: f64) -> f64 {
    0.5 * d as f64 * total * TAU.ln()
}
