//! `jacoflow.filters`: the generic filters with numpy arrays and Python callbacks.

mod callback;
mod extended;
mod gaussian;
mod kalman;
mod manifold;
mod particle;
mod sequence;
mod sigma_points;
mod unscented;

pub use extended::{ExtendedKalmanFilter, restore_extended};
pub use gaussian::GaussianFilter;
pub use kalman::{KalmanFilter, restore_kalman};
pub use particle::{ParticleFilter, resample, restore_particle};
pub use sigma_points::MerweScaledSigmaPoints;
pub use unscented::{UnscentedKalmanFilter, restore_unscented};
