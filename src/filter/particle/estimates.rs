//! Estimates from the weighted particles of each set.

use super::{state::ParticleFilter, weights::effective_sample_size_of_logs};
use crate::error::{Error, Result};

impl ParticleFilter {
    /// Effective sample size `1 / sum w^2` of each set, `(B)`.
    ///
    /// # Errors
    /// [`Error::Argument`] when the public arrays do not fit one another, as for all estimates.
    pub fn effective_sample_size(&self) -> Result<Vec<f64>> {
        self.check()?;
        Ok(self.log_weights.chunks_exact(self.particles()).map(effective_sample_size_of_logs).collect())
    }

    /// Weighted means `sum w x` `(B, n)`.
    pub fn mean(&self) -> Result<Vec<f64>> {
        self.check()?;
        let n = self.dim_x;
        let mut means = vec![0.0; self.batch * n];
        for (mean, (x, logs)) in means.chunks_exact_mut(n).zip(self.sets()) {
            for (x, log) in x.chunks_exact(n).zip(logs) {
                let weight = log.exp();
                mean.iter_mut().zip(x).for_each(|(mean, x)| *mean += weight * x);
            }
        }
        Ok(means)
    }

    /// Weighted covariances `sum w (x - mean)(x - mean)^T` `(B, n, n)`, not corrected for finite `N`.
    pub fn covariance(&self) -> Result<Vec<f64>> {
        let (n, means) = (self.dim_x, self.mean()?);
        let mut covariances = vec![0.0; self.batch * n * n];
        let mut departure = vec![0.0; n];
        let sets = covariances.chunks_exact_mut(n * n).zip(means.chunks_exact(n)).zip(self.sets());
        for ((covariance, mean), (x, logs)) in sets {
            for (x, log) in x.chunks_exact(n).zip(logs) {
                let weight = log.exp();
                departure.iter_mut().zip(x.iter().zip(mean)).for_each(|(departure, (x, mean))| *departure = x - mean);
                for (row, a) in covariance.chunks_exact_mut(n).zip(&departure) {
                    row.iter_mut().zip(&departure).for_each(|(value, b)| *value += weight * (a * b));
                }
            }
        }
        Ok(covariances)
    }

    /// The particle with the largest weight of each set, `(B, n)`; the first of equals.
    ///
    /// It stands for the posterior's maximum only before resampling: afterwards all weights are equal.
    pub fn map(&self) -> Result<Vec<f64>> {
        self.check()?;
        let mut all = Vec::with_capacity(self.batch * self.dim_x);
        for (x, logs) in self.sets() {
            let best = (0..logs.len()).reduce(|best, i| if logs[i] > logs[best] { i } else { best }).unwrap_or(0);
            all.extend_from_slice(&x[best * self.dim_x..(best + 1) * self.dim_x]);
        }
        Ok(all)
    }

    /// Marginal quantiles of every component at the `levels` in [0, 1]: `(levels, B, n)`.
    ///
    /// The smallest value, of positive weight, at which the cumulative weight is at least q.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `q` for a level outside [0, 1].
    pub fn quantiles(&self, levels: &[f64]) -> Result<Vec<f64>> {
        self.check()?;
        if let Some(level) = levels.iter().find(|level| !(0.0..=1.0).contains(*level)) {
            return Err(Error::argument("q", "numbers from 0 to 1", level));
        }
        let (n, b) = (self.dim_x, self.batch);
        let mut all = vec![0.0; levels.len() * b * n];
        for (set, (x, logs)) in self.sets().enumerate() {
            let weights: Vec<f64> = logs.iter().map(|log| log.exp()).collect();
            for component in 0..n {
                let pairs = weights.iter().enumerate().map(|(i, &weight)| (x[i * n + component], weight));
                let mut sorted: Vec<_> = pairs.filter(|(_, weight)| *weight > 0.0).collect();
                sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
                for (k, value) in quantiles_of(&mut sorted, levels).enumerate() {
                    all[(k * b + set) * n + component] = value;
                }
            }
        }
        Ok(all)
    }

    /// Particles and log weights of each set.
    fn sets(&self) -> impl Iterator<Item = (&[f64], &[f64])> {
        let count = self.particles();
        self.x.chunks_exact(count * self.dim_x).zip(self.log_weights.chunks_exact(count))
    }
}

/// Quantiles of (value, weight) pairs in ascending order; replaces the weights by their cumulative sums.
fn quantiles_of(sorted: &mut [(f64, f64)], levels: &[f64]) -> impl Iterator<Item = f64> {
    let mut total = 0.0;
    for (_, weight) in &mut *sorted {
        total += *weight;
        *weight = total;
    }
    levels.iter().map(move |level| {
        let at = sorted.partition_point(|(_, sum)| *sum < level * total);
        sorted.get(at).or(sorted.last()).map_or(f64::NAN, |(value, _)| *value)
    })
}
