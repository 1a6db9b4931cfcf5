//! Gaussian-filtered white noise that can be read between its lattice points.

use super::Texture;
use crate::error::{Error, Result};
use crate::math::random::CounterRng;

/// Lattice points along each side after which the noise repeats, px. A power of two.
const PERIOD: usize = 1024;
/// Reach of the Gaussian, in its standard deviations: the rest is below 1e-10.
const REACH: f64 = 7.0;
/// Widest Gaussian, px: twice its reach must stay well below the period.
const MAX_SIGMA: f64 = 32.0;

/// Band-limited noise `I(x) = mean + a sum_k n_k exp(-|x - k|^2 / (2 sigma^2))` over lattice points `k` with
/// white normal `n_k`.
///
/// With `a = std / (sigma sqrt(pi))` its standard deviation is `std` and its autocorrelation `exp(-r^2 / (4
/// sigma^2))`: exactly the statistics of white noise filtered by a Gaussian of standard deviation `sigma`,
/// without any interpolation. It repeats every 1024 px.
#[derive(Debug, Clone)]
pub struct Noise {
    lattice: Vec<f64>,
    sigma: f64,
    mean: f64,
    amplitude: f64,
}

impl Noise {
    /// Noise of standard deviation `std` grey levels about `mean`, filtered by a Gaussian of `sigma` px.
    ///
    /// # Errors
    /// [`Error::Argument`] for a `sigma` outside 0.5 to 32 px (a narrower one would show the lattice) or a
    /// `std` or `mean` that is not finite.
    pub fn new(sigma: f64, std: f64, mean: f64, seed: u64) -> Result<Self> {
        if !(0.5..=MAX_SIGMA).contains(&sigma) {
            return Err(Error::argument("sigma", format!("0.5 to {MAX_SIGMA} px"), sigma));
        }
        if !(std.is_finite() && std >= 0.0) {
            return Err(Error::argument("std", "a finite number of grey levels, 0 or more", std));
        }
        if !mean.is_finite() {
            return Err(Error::argument("mean", "a finite number of grey levels", mean));
        }
        let rng = CounterRng::new(seed);
        let lattice = (0..(PERIOD * PERIOD) as u64).map(|k| rng.normal(k)).collect();
        let amplitude = std / (sigma * std::f64::consts::PI.sqrt());
        Ok(Self { lattice, sigma, mean, amplitude })
    }

    /// `exp(-(first + i - x)^2 / (2 sigma^2))` for i = 0, 1, ... by the recurrence of its ratios: two
    /// exponentials instead of one a term.
    fn weights(&self, first: f64, x: f64, into: &mut [f64]) {
        let inverse = 1.0 / (self.sigma * self.sigma);
        let distance = first - x;
        let mut value = (-0.5 * distance * distance * inverse).exp();
        let mut ratio = (-(distance + 0.5) * inverse).exp();
        let change = (-inverse).exp();
        for weight in into {
            *weight = value;
            value *= ratio;
            ratio *= change;
        }
    }
}

impl Texture for Noise {
    fn value(&self, x: f64, y: f64) -> f64 {
        const MAX_TAPS: usize = 2 * (REACH * MAX_SIGMA) as usize + 2;
        if !(x.is_finite() && y.is_finite()) {
            return f64::NAN;
        }
        let reach = (REACH * self.sigma).ceil();
        let taps = 2 * reach as usize;
        let (first_x, first_y) = (x.floor() - reach + 1.0, y.floor() - reach + 1.0);
        let (mut weight_x, mut weight_y, mut sums) = ([0.0; MAX_TAPS], [0.0; MAX_TAPS], [0.0; MAX_TAPS]);
        let (weight_x, weight_y, sums) = (&mut weight_x[..taps], &mut weight_y[..taps], &mut sums[..taps]);
        self.weights(first_x, x, weight_x);
        self.weights(first_y, y, weight_y);
        let period = PERIOD as f64;
        let (column, row) = (first_x.rem_euclid(period) as usize, first_y.rem_euclid(period) as usize);
        // Down the columns first, so that the inner loop runs over neighbours without a reduction.
        let head = taps.min(PERIOD - column);
        for (j, &weight) in weight_y.iter().enumerate() {
            let start = ((row + j) % PERIOD) * PERIOD;
            let line = &self.lattice[start..start + PERIOD];
            for (sum, &noise) in sums[..head].iter_mut().zip(&line[column..]) {
                *sum += weight * noise;
            }
            for (sum, &noise) in sums[head..].iter_mut().zip(line) {
                *sum += weight * noise;
            }
        }
        let total: f64 = sums.iter().zip(weight_x.iter()).map(|(s, w)| s * w).sum();
        self.mean + self.amplitude * total
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_the_plain_sum_over_the_lattice() {
        let texture = Noise::new(1.3, 10.0, 50.0, 5).unwrap();
        for (x, y) in [(3.7f64, -2.2f64), (1023.4, 0.1), (500.0, 1020.9), (-7.5, 2049.25)] {
            let mut sum = 0.0;
            for j in -12..=12 {
                for i in -12..=12 {
                    let (kx, ky) = (x.floor() + f64::from(i), y.floor() + f64::from(j));
                    let index = ky.rem_euclid(1024.0) as usize * PERIOD + kx.rem_euclid(1024.0) as usize;
                    let squared = (x - kx).powi(2) + (y - ky).powi(2);
                    sum += texture.lattice[index] * (-squared / (2.0 * 1.3 * 1.3)).exp();
                }
            }
            let want = 50.0 + 10.0 / (1.3 * std::f64::consts::PI.sqrt()) * sum;
            assert!((texture.value(x, y) - want).abs() < 1e-8, "{x} {y}");
        }
    }
}
