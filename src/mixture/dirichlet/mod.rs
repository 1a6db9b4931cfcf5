//! Dirichlet-process mixtures of Gaussians for weighted points, by expectation-maximization with merging or by variational Bayes.
//!
//! `v_k ~ Beta(1, alpha)`, `pi_k = v_k prod_(j<k) (1 - v_j)`, `(mu_k, Sigma_k) ~ NIW(m0, kappa0, nu0, Psi0)`, truncated at K
//! components. T. Ferguson, "A Bayesian analysis of some nonparametric problems" (1973); D. Blei and M. Jordan, "Variational
//! inference for Dirichlet process mixtures" (2006). `docs/dirichlet_mixture.md` has all equations.
//!
//! ```
//! use jacoflow::mixture::{DirichletOptions, Points, fit_dirichlet};
//! # fn main() -> jacoflow::Result<()> {
//! // Points about 0 and about 10; twelve components are allowed.
//! let x: Vec<f64> = (0..300).map(|i| f64::from(u8::from(i % 3 == 0)) * 10.0 + (f64::from(i) * 0.7).sin()).collect();
//! let mixture = fit_dirichlet(&Points { dimensions: 1, values: &x, weights: None }, &DirichletOptions::default())?;
//! assert_eq!(mixture.n_active(), 2);
//! assert!((mixture.weights[0] - 2.0 / 3.0).abs() < 1e-6 && mixture.means[0].abs() < 0.05);
//! # Ok(())
//! # }
//! ```

mod components;
mod em;
mod fit;
mod merge;
mod options;
mod result;
mod score;
mod sticks;
#[cfg(test)]
mod tests;

pub use fit::{fit_dirichlet, fit_dirichlet_from};
pub use options::{DirichletOptions, Inference};
pub use result::DirichletMixture;
