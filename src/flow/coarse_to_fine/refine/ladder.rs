//! Ladder of windows: the grid that each is computed on, its taps, and the noise it leaves.

use crate::flow::coarse_to_fine::extended::RIM;
use crate::flow::moment_filter::weights;
use crate::simd::SimdReal;
use std::f64::consts::PI;

/// Each coarser grid takes every second site.
pub(super) const MAX_OCTAVE: usize = 2;
/// Iterations towards a variance: enough for the last bits of single precision.
const VARIANCE_STEPS: usize = 12;
/// Maximum sigma of a window on a grid, sites; the next grid is fine enough for wider ones.
const MAX_GRID_SIGMA: f64 = 2.9;
/// Variance of the Gaussian before a grid is halved, sites^2: damps aliases a thousand times.
const HALVING_VARIANCE: f64 = 1.5;

/// Coefficients of `G, G^2, ...`: `4 G - 6 G^2 + 4 G^3 - G^4 = 1 - (1 - G)^4`.
pub(in crate::flow::coarse_to_fine) const TERMS: [f64; 4] = [4.0, -6.0, 4.0, -1.0];
pub(super) const EXTRA_PASSES: usize = TERMS.len() - 1;

/// Filters `[g, g k / (pitch sum g k^2)]` at distance k: mean and slope of a weighted line.
#[derive(Debug, Clone)]
pub(super) struct Taps<T> {
    /// Distance 0 ..= radius; the third filter of the type is not used.
    pub taps: Vec<[T; 3]>,
    /// The window's variance, px^2.
    pub variance: f64,
}

impl<T: SimdReal> Taps<T> {
    /// A Gaussian of `sigma` sites, `pitch` px apart, truncated at 3 sigma and at the rim.
    pub fn gaussian(sigma: f64, pitch: f64) -> Self {
        Self::cut_off(sigma, ((3.0 * sigma + 0.5) as usize).clamp(1, RIM), pitch)
    }

    /// A Gaussian that has this variance, px^2, after truncation.
    fn of_variance(variance: f64, pitch: f64) -> Self {
        let mut sigma = variance.sqrt() / pitch;
        let radius = ((3.0 * sigma + 0.5) as usize).clamp(1, RIM);
        // The variance grows nearly as that of the Gaussian.
        for _ in 0..VARIANCE_STEPS {
            sigma *= (variance / Self::cut_off(sigma, radius, pitch).variance).sqrt();
        }
        Self::cut_off(sigma, radius, pitch)
    }

    fn cut_off(sigma: f64, radius: usize, pitch: f64) -> Self {
        let g = weights(sigma, radius);
        let variance = 2.0 * moment(&g, 2);
        // Truncation takes most from the fourth moment: the Gaussian of the slope is widened for it.
        let mut slope = sigma;
        for _ in 0..VARIANCE_STEPS {
            let h = weights(slope, radius);
            slope *= (3.0 * variance * moment(&h, 2) / moment(&h, 4)).sqrt();
        }
        let h = weights(slope, radius);
        let lever = 2.0 * moment(&h, 2) * pitch;
        let taps = g.iter().zip(&h).enumerate();
        let taps = taps.map(|(k, (&g, &h))| [g, k as f64 * h / lever, 0.0].map(T::from_f64));
        Self { taps: taps.collect(), variance: variance * pitch * pitch }
    }

    #[cfg(test)]
    pub fn radius(&self) -> usize {
        self.taps.len() - 1
    }
}

/// Sum of weights times a power of the distance, on one side.
fn moment(weights: &[f64], power: i32) -> f64 {
    weights.iter().enumerate().map(|(k, g)| (k as f64).powi(power) * g).sum()
}

#[derive(Debug, Clone)]
pub(super) struct Scale<T> {
    /// Standard deviation, px.
    pub sigma: f64,
    /// It is computed on every `2^octave`-th site.
    pub octave: usize,
    /// The remaining part of the window after the smoothing of its grid.
    pub first: Taps<T>,
    /// Windows of one, two, ... times its variance: smoothing once, twice, ... more.
    pub again: [Taps<T>; EXTRA_PASSES],
    /// Variance of the resulting window, px^2.
    pub variance: f64,
}

#[derive(Debug, Clone)]
pub(super) struct Ladder<T> {
    pub scales: Vec<Scale<T>>,
    pub halving: Taps<T>,
    /// Distance of the finest sites, px.
    pub pitch: f64,
}

impl<T: SimdReal> Ladder<T> {
    /// For windows of `sigmas` px, growing, on sites `pitch` px apart.
    pub fn new(sigmas: &[f64], pitch: f64) -> Self {
        let halving = Taps::gaussian(HALVING_VARIANCE.sqrt(), 1.0);
        let scales = sigmas.iter().map(|&sigma| {
            let (mut octave, mut whole, mut smoothed, mut distance) = (0, sigma / pitch, 0.0, pitch);
            while whole > MAX_GRID_SIGMA && octave < MAX_OCTAVE {
                smoothed = (smoothed + halving.variance) / 4.0;
                (octave, whole, distance) = (octave + 1, whole / 2.0, 2.0 * distance);
            }
            let first = Taps::gaussian((whole * whole - smoothed).sqrt(), distance);
            let variance = first.variance + smoothed * distance * distance;
            let again =
                std::array::from_fn(|n| (n + 1) as f64).map(|times| Taps::of_variance(times * variance, distance));
            Scale { sigma, octave, first, again, variance }
        });
        Self { scales: scales.collect(), halving: halving.clone(), pitch }
    }

    pub fn octaves(&self) -> usize {
        self.scales.iter().map(|s| s.octave).max().unwrap_or(0)
    }
}

/// Variance of the difference of two windows' estimates, for white noise of unit density (per px^2).
///
/// With the transfer functions `H = 1 - (1 - G)^4`, `G = exp(-sigma^2 w^2 / 2)`, it is `integral (H_a -
/// H_b)^2 w dw / (2 pi)`, each term of which is a Gaussian.
pub(super) fn difference_variance(a: f64, b: f64) -> f64 {
    let window = |sign: f64, s: f64| TERMS.into_iter().zip(1..).map(move |(c, n)| (sign * c, f64::from(n) * s * s));
    let terms: Vec<_> = window(1.0, a).chain(window(-1.0, b)).collect();
    terms.iter().flat_map(|(c, s)| terms.iter().map(move |(d, t)| c * d / (2.0 * PI * (s + t)))).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_of_lines_are_exact_and_grids_follow_the_window() {
        let ladder = Ladder::<f64>::new(&[1.5, 2.5, 4.0, 6.0, 9.0, 13.0, 18.0], 2.0);
        assert_eq!(ladder.scales.iter().map(|s| s.octave).collect::<Vec<_>>(), [0, 0, 0, 1, 1, 2, 2]);
        for s in &ladder.scales {
            let pitch = 2.0 * f64::from(1 << s.octave as u32);
            for taps in s.again.iter().chain([&s.first]) {
                let slope: f64 = taps.taps.iter().enumerate().map(|(k, t)| 2.0 * t[1] * k as f64 * pitch).sum();
                assert!((slope - 1.0).abs() < 1e-13 && taps.radius() <= RIM);
            }
            // Cut off at 3 sigma, a Gaussian keeps 97 % of its variance.
            assert!((s.variance / (s.sigma * s.sigma) - 0.98).abs() < 0.04, "{} {}", s.sigma, s.variance);
        }
    }
}
