//! Constants of the covariance: moments of the noise, windows, truncation.

use super::combine::Combination;
use super::high_frequencies;
use super::noise::{PixelNoise, smoothing_weights};
use super::options::WindowedOptions;
use super::rows::Plan;
use super::truncation::Truncation;
use super::window::Window;
use crate::flow::options::EstimatorOptions;
use crate::jet::JetStencil;
use crate::simd::{Level, SimdReal};

/// Constants of the covariance.
pub(super) struct NoiseSetting<T> {
    /// Second moments of the noise.
    pub pixel: PixelNoise,
    /// The stencil: offset and weights of each of its samples.
    pub taps: Vec<((isize, isize), [T; 6])>,
    /// Largest offset of the stencil, px.
    pub reach: usize,
    /// Kernel of the smoothing as the window sees it, or of radius 0.
    pub smoothing: Window<T>,
    /// The window of the normal equations.
    pub window: Window<T>,
    /// Squared weights of the noisy samples.
    pub squared: Window<T>,
    /// 1 / sigma of the window.
    pub scale: f64,
    /// Equations a pixel.
    pub rows: usize,
    /// Variance of the pixel noise; `None`: from the frames.
    pub variance: Option<f64>,
    /// Smallest variance of the pixel noise: that of rounding, for frames of whole grey levels.
    pub min_variance: f64,
    /// What truncation leaves.
    pub truncation: Truncation,
    /// Energy of the high frequencies per variance of the noise.
    pub high_frequency_gain: f64,
    /// Whether the noise's part of the covariance is reported, too.
    pub parts: bool,
    /// Instruction set.
    pub level: Level,
}

impl<T: SimdReal> NoiseSetting<T> {
    /// For these options and their stencil, frames that hold whole numbers or not, and the window of the
    /// estimates.
    pub fn new(
        (options, stencil): (&WindowedOptions, &JetStencil),
        (common, rounded): (&EstimatorOptions, bool),
        window: Window<T>,
        frames: usize,
    ) -> Self {
        let combination = Combination::of(frames, options.scheme);
        let smooth = options.presmooth;
        let reach = stencil.reach();
        // The window leaves of the kernel only what it weighs alike.
        let narrowed = smooth.map(|s| s * options.sigma / options.sigma.hypot(s));
        let truncation = Truncation::new(stencil, combination, smooth);
        let rows = options.rows.count();
        Self {
            pixel: PixelNoise::new(stencil, combination, rows, smooth, options.sigma, &truncation),
            taps: Self::taps(stencil),
            reach: reach.left.max(reach.right).max(reach.up).max(reach.down),
            smoothing: Window::smoothing(&narrowed.map_or_else(|| vec![1.0], smoothing_weights)),
            squared: Window::squared(options.sigma, options.radius(), smooth.unwrap_or(0.0)),
            window,
            scale: 1.0 / options.sigma,
            rows,
            truncation,
            high_frequency_gain: high_frequencies::gain(combination),
            variance: common.noise.map(|n| n * n),
            min_variance: if rounded { 1.0 / 12.0 } else { 0.0 },
            parts: common.systematic,
            level: common.level(),
        }
    }

    /// Offsets and weights of a stencil in working precision.
    fn taps(stencil: &JetStencil) -> Vec<((isize, isize), [T; 6])> {
        let pairs = stencil.offsets().iter().zip(stencil.weights());
        pairs.map(|(&(x, y), w)| ((x as isize, y as isize), w.map(T::from_f64))).collect()
    }

    /// Unknowns that have a column of their own in the equations; with row 1 alone the others act by
    /// transport only.
    pub fn unknowns(&self) -> usize {
        if self.rows == 1 { 2 } else { 6 }
    }

    /// The products of those.
    pub fn plan(&self) -> Plan {
        if self.rows == 1 { Plan::flow() } else { Plan::outer() }
    }

    /// How far beyond a site estimates of the motion are used, px.
    pub fn margin(&self) -> usize {
        (self.squared.radius() + self.smoothing.radius() + self.reach).max(self.window.radius() + 1)
    }
}
