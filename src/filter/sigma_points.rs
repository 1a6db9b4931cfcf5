//! Scaled sigma points (R. van der Merwe, "Sigma-point Kalman filters for probabilistic inference in dynamic
//! state-space models", 2004).

use crate::error::{Error, Result};

/// The constants of the scaled unscented transform, with a Cholesky factor as matrix square root.
///
/// For `n` dimensions `lambda = alpha^2 (n + kappa) - n` and the points are `x` and `x +- column_k(L) sqrt(n
/// + lambda)` with `P = L L^T`. Weights: mean `lambda / (n + lambda)` and `1 / (2 (n + lambda))`; for the
/// covariance the first one gains `1 - alpha^2 + beta`.
///
/// By default the points are `x +- sqrt(n) column_k(L)`, and the centre has no weight in the mean.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SigmaPoints {
    /// Spread of the points around the mean, > 0.
    pub alpha: f64,
    /// Knowledge of the distribution: 2 is best for a Gaussian.
    pub beta: f64,
    /// Second scale; `n + kappa` must be positive.
    pub kappa: f64,
}

impl Default for SigmaPoints {
    fn default() -> Self {
        Self { alpha: 1.0, beta: 2.0, kappa: 0.0 }
    }
}

impl SigmaPoints {
    /// Checked constants.
    ///
    /// # Errors
    /// [`Error::Argument`] when `alpha` is not positive or any of them is not finite.
    pub fn new(alpha: f64, beta: f64, kappa: f64) -> Result<Self> {
        let points = Self { alpha, beta, kappa };
        points.check(usize::MAX >> 12).map(|()| points)
    }

    /// Checks the constants for `n` dimensions.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the constant.
    pub fn check(&self, n: usize) -> Result<()> {
        if !(self.alpha.is_finite() && self.alpha > 0.0) {
            return Err(Error::argument("alpha", "a positive number", self.alpha));
        }
        if !self.beta.is_finite() {
            return Err(Error::argument("beta", "a finite number", self.beta));
        }
        if !(self.kappa.is_finite() && n as f64 + self.kappa > 0.0) {
            return Err(Error::argument("kappa", format!("a finite number above -{n}"), self.kappa));
        }
        Ok(())
    }

    /// `n + lambda = alpha^2 (n + kappa)`: the squared spread of the points.
    pub fn spread(&self, n: usize) -> f64 {
        self.alpha * self.alpha * (n as f64 + self.kappa)
    }

    /// How many points for `n` dimensions: `2 n + 1`.
    pub fn count(n: usize) -> usize {
        2 * n + 1
    }

    /// Weights of the mean, `(2 n + 1)`, centre first.
    pub fn mean_weights(&self, n: usize) -> Vec<f64> {
        let c = self.spread(n);
        let mut weights = vec![0.5 / c; Self::count(n)];
        weights[0] = (c - n as f64) / c;
        weights
    }

    /// Weights of the covariance, `(2 n + 1)`, centre first.
    pub fn covariance_weights(&self, n: usize) -> Vec<f64> {
        let mut weights = self.mean_weights(n);
        weights[0] += 1.0 - self.alpha * self.alpha + self.beta;
        weights
    }

    /// The points `(2 n + 1, n)` of mean `x` and lower Cholesky factor `l`: centre, every `+`, every `-`.
    pub(super) fn draw(&self, x: &[f64], l: &[f64], out: &mut [f64]) {
        let n = x.len();
        let scale = self.spread(n).sqrt();
        for row in out.chunks_exact_mut(n) {
            row.copy_from_slice(x);
        }
        for k in 0..n {
            for i in 0..n {
                let step = scale * l[i * n + k];
                out[(1 + k) * n + i] += step;
                out[(1 + n + k) * n + i] -= step;
            }
        }
    }

    /// The sigma points `(2 n + 1, n)` of mean `x` `(n)` and covariance `p` `(n, n)`.
    ///
    /// # Errors
    /// [`Error::Argument`] for wrong sizes and a mean that is not finite, [`Error::Numerical`] when `p` is
    /// not positive definite.
    pub fn sigma_points(&self, x: &[f64], p: &[f64]) -> Result<Vec<f64>> {
        let n = x.len();
        if n == 0 || p.len() != n * n {
            return Err(Error::argument("P", format!("a {n} x {n} matrix with n > 0"), format!("{} values", p.len())));
        }
        super::checks::check_dimension("x", n)?;
        super::checks::check_mean(x)?;
        self.check(n)?;
        let mut l = vec![0.0; n * n];
        if !crate::math::dense::cholesky(p, n, &mut l) {
            return Err(Error::Numerical("P is not positive definite".into()));
        }
        let mut out = vec![0.0; Self::count(n) * n];
        self.draw(x, &l, &mut out);
        Ok(out)
    }
}
