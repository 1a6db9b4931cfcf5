//! `jacoflow.filters`: the generic filters with numpy arrays and Python callbacks.

mod callback;
mod extended;
mod gaussian;
mod kalman;
mod sigma_points;
mod unscented;

pub use extended::{ExtendedKalmanFilter, restore_extended};
pub use gaussian::GaussianFilter;
pub use kalman::{KalmanFilter, restore_kalman};
pub use sigma_points::MerweScaledSigmaPoints;
pub use unscented::{UnscentedKalmanFilter, restore_unscented};
