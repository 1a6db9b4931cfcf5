//! Particle filters.

mod resampling;
mod weights;

pub use resampling::{Resampling, resample_indices};
pub use weights::{effective_sample_size, linear_weights, normalise_log_weights};
