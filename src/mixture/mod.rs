//! Mixtures of Gaussians for weighted points: with a Dirichlet prior on the proportions by variational Bayes
//! ([`fit()`]), and Dirichlet-process mixtures ([`fit_dirichlet`]).
//!
//! A mixture of K Gaussians in D dimensions with a Dirichlet prior on its proportions and Gauss-Wishart
//! priors on means and precisions; q(Z) q(pi, mu, Lambda) approximates its posterior (C. Bishop, "Pattern
//! Recognition and Machine Learning", 2006, section 10.2; equations (6) to (28) of the stereo paper, which
//! adds the weights). A point's weight is evidence: a weight of 3 is the point three times. Surplus
//! components lose their points and go back to the prior.
//!
//! `fit` repeats rounds from `seeding` or `start`: `expectation` (with `densities`) leaves `moments` of the
//! points, from which `posterior` follows under the `prior`; `bound` ends them. `online` takes batches.
//!
//! ```
//! use jacoflow::mixture::{CovariancePrior, MixtureOptions, Points, Start, fit};
//! # fn main() -> jacoflow::Result<()> {
//! // Points about 0 and about 10, those about 10 three times.
//! let x: Vec<f64> = (0..200).map(|i| f64::from(i % 2) * 10.0 + (f64::from(i) * 0.7).sin()).collect();
//! let weights: Vec<f64> = (0..200).map(|i| if i % 2 == 0 { 1.0 } else { 3.0 }).collect();
//! let covariance_prior = CovariancePrior::Isotropic(0.1);
//! let options = MixtureOptions { components: 2, covariance_prior, ..MixtureOptions::default() };
//! let fit = fit(&Points { dimensions: 1, values: &x, weights: Some(&weights) }, &options, Start::Seeds)?;
//! let heavy = if fit.posterior.means[0] > fit.posterior.means[1] { 0 } else { 1 };
//! assert!((fit.posterior.means[heavy] - 10.0).abs() < 0.1);
//! assert!((fit.moments.counts[heavy] - 300.0).abs() < 1e-6);
//! # Ok(())
//! # }
//! ```

mod bound;
mod densities;
mod dirichlet;
mod expectation;
mod fit;
mod moments;
mod online;
mod options;
mod points;
mod posterior;
mod prior;
mod seeding;
mod start;

pub use dirichlet::{DirichletMixture, DirichletOptions, Inference, fit_dirichlet, fit_dirichlet_from};
pub use fit::{Fit, Start, fit};
pub use moments::Moments;
pub use online::{Retained, partial_fit};
pub use options::{CovariancePrior, MixtureOptions, Seeding};
pub use points::Points;
pub use posterior::Posterior;
pub use prior::Prior;
