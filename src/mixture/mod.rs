//! Mixtures of Gaussians fitted by variational Bayes, with weighted points.
//!
//! A mixture of K Gaussians in D dimensions with a Dirichlet prior on its proportions and Gauss-Wishart priors on means and precisions; q(Z) q(pi, mu, Lambda) approximates its posterior (C. Bishop, "Pattern Recognition and Machine
//! Learning", 2006, section 10.2; equations (6) to (28) of the stereo paper, which adds the weights). A point's weight is evidence: a weight of 3 is the point three times. Surplus components lose their points and go back to the prior.
//!
//! ```
//! use jacoflow::mixture::{CovariancePrior, MixtureOptions, Points, Start, fit};
//! # fn main() -> jacoflow::Result<()> {
//! let x: Vec<f64> = (0..200).map(|i| f64::from(i % 2) * 10.0 + f64::from(i) * 0.01).collect();
//! let options = MixtureOptions { components: 4, covariance_prior: CovariancePrior::Isotropic(0.1), ..MixtureOptions::default() };
//! let fit = fit(&Points { dimensions: 1, values: &x, weights: None }, &options, Start::Seeds)?;
//! let used = fit.posterior.weight_concentration.iter().filter(|a| **a > 10.0).count();
//! assert_eq!(used, 2);
//! # Ok(())
//! # }
//! ```

mod bound;
mod expectation;
mod fit;
mod moments;
mod online;
mod options;
mod points;
mod posterior;
mod prior;
mod seeding;
#[cfg(test)]
mod tests;

pub use fit::{Fit, Start, fit};
pub use moments::Moments;
pub use online::{Retained, partial_fit};
pub use options::{CovariancePrior, MixtureOptions, Seeding};
pub use points::Points;
pub use posterior::Posterior;
pub use prior::Prior;
