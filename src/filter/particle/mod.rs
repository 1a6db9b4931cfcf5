//! Particle filters: the posterior as weighted samples, for any transition and any likelihood.
//!
//! A cycle is [`predict`](ParticleFilter::predict) (each particle moves at random),
//! [`update`](ParticleFilter::update) (its weight is multiplied by the likelihood) and
//! [`resample`](ParticleFilter::resample) (N. Gordon, D. Salmond, A. Smith, "Novel approach to
//! nonlinear/non-Gaussian Bayesian state estimation", 1993). Weights are kept as logarithms and normalised by
//! log-sum-exp. Arrays are row-major with a leading batch axis: `x` is `(B, N, n)`, `log_weights` `(B, N)`.
//!
//! Random numbers are addressed by (seed, target, step, particle, component): results are bit-identical for
//! any number of threads, and a batch entry has the same particles for any other entries.
//!
//! `state` holds the sets; `predict` (with `noise`), `update` (with `weights`) and `select` (with
//! `resampling`) are the steps of the cycle, `estimates` what is read off.
//!
//! ```
//! use jacoflow::filter::particle::{ParticleFilter, Resampling};
//! # fn main() -> jacoflow::Result<()> {
//! // A random walk whose square is measured: two modes.
//! let mut filter = ParticleFilter::new(1, 2000, 1, 7)?;
//! filter.sample_gaussian(&[0.0], &[4.0])?;
//! for _ in 0..10 {
//!     filter.predict_linear(&[1.0], &[0.01])?;
//!     filter.update(|x, log_likelihood| {
//!         for (x, log_likelihood) in x.iter().zip(log_likelihood) {
//!             *log_likelihood = -0.5 * ((x * x - 4.0) / 0.5).powi(2);
//!         }
//!         Ok(())
//!     })?;
//!     filter.resample(Resampling::Systematic, Some(0.5), None)?;
//! }
//! let quantiles = filter.quantiles(&[0.05, 0.95])?;
//! assert!((quantiles[0] + 2.0).abs() < 0.4 && (quantiles[1] - 2.0).abs() < 0.4);
//! # Ok(())
//! # }
//! ```

mod estimates;
mod noise;
mod predict;
mod resampling;
mod select;
mod state;
mod update;
mod weights;

pub use resampling::{Resampling, resample_indices};
pub use state::ParticleFilter;
pub use weights::{effective_sample_size, linear_weights, normalise_log_weights};
