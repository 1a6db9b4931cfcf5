//! Robust statistics of brightness: the scatter about the median, and the noise of two frames.

use crate::math::{median, robust_std};
use crate::types::Frame;

/// Pixels that the noise of two frames is measured on, about.
pub(super) const NOISE_SAMPLES: usize = 2048;

/// Noise of the frames from their difference on about so many `samples`, `1.4826 median|E(t+1) - E(t)| / sqrt
/// 2`, grey levels; 0 where they have no common pixel.
pub(super) fn noise_of(first: &Frame<f64>, second: &Frame<f64>, samples: usize) -> f64 {
    let every = (first.data().len() / samples).max(1) | 1;
    let pairs = first.data().iter().zip(second.data()).step_by(every);
    let mut differences: Vec<f64> = pairs.map(|(a, b)| (b - a).abs()).filter(|d| d.is_finite()).collect();
    robust_std(&mut differences).unwrap_or(0.0) / std::f64::consts::SQRT_2
}

/// Standard deviation of values about their median, robustly; 0 of nothing.
pub(super) fn scatter_of(mut values: Vec<f64>) -> f64 {
    let middle = median(&mut values).unwrap_or(0.0);
    for value in &mut values {
        *value = (*value - middle).abs();
    }
    robust_std(&mut values).unwrap_or(0.0)
}
