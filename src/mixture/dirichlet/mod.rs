//! Dirichlet-process mixtures of Gaussians for weighted points, by EM with merging or by VB.
//!
//! `v_k ~ Beta(1, alpha)`, `pi_k = v_k prod_(j<k) (1 - v_j)`, `(mu_k, Sigma_k) ~ NIW(m0, kappa0, nu0, Psi0)`,
//! truncated at K components. T. Ferguson, "A Bayesian analysis of some nonparametric problems" (1973); D.
//! Blei and M. Jordan, "Variational inference for Dirichlet process mixtures" (2006).
//! `docs/dirichlet_mixture.md` has all equations.
//!
//! `fit` is the entry point; `em` repeats rounds (`components` and `sticks` are its M step), `merge` pools
//! components while that raises the `score`.
//!
//! ```
//! use jacoflow::math::random::CounterRng;
//! use jacoflow::mixture::{DirichletOptions, Points, fit_dirichlet};
//! # fn main() -> jacoflow::Result<()> {
//! // 200 points about 0 and 100 about 10; twelve components are allowed.
//! let rng = CounterRng::new(0);
//! let x: Vec<f64> = (0..300).map(|i| if i < 200 { 0.0 } else { 10.0 } + rng.normal(i)).collect();
//! let points = Points { dimensions: 1, values: &x, weights: None };
//! let mixture = fit_dirichlet(&points, &DirichletOptions::default())?;
//! assert_eq!(mixture.n_active(), 2);
//! assert!((mixture.weights[0] - 2.0 / 3.0).abs() < 0.01 && (mixture.means[1] - 10.0).abs() < 0.5);
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
