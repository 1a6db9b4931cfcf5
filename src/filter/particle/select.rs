//! Resampling of the sets of a filter.

use super::resampling::Resampling;
use super::state::{ParticleFilter, Purpose, check_count};
use super::weights::{effective_sample_size, linear_weights};
use crate::error::{Error, Result};

impl ParticleFilter {
    /// Selects `count` particles of each set by weight (none: as many as before); then all weights are equal.
    ///
    /// With a `threshold` only sets whose effective sample size is below `threshold` N are resampled, unless
    /// `count` differs from N. Returns which sets were, `(B)`.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `n_particles` or `threshold`, which must lie in [0, 1].
    pub fn resample(&mut self, scheme: Resampling, threshold: Option<f64>, count: Option<usize>) -> Result<Vec<bool>> {
        self.check()?;
        if let Some(value) = threshold.filter(|value| !(0.0..=1.0).contains(value)) {
            return Err(Error::argument("threshold", "a number from 0 to 1", value));
        }
        let (n, before) = (self.dim_x, self.particles());
        let count = count.unwrap_or(before);
        check_count(self.batch, count, n)?;
        let mut x = Vec::with_capacity(self.batch * count * n);
        let mut log_weights = Vec::with_capacity(self.batch * count);
        let (mut weights, mut indices, mut resampled) = (vec![], vec![], vec![]);
        for set in 0..self.batch {
            let particles = &self.x[set * before * n..(set + 1) * before * n];
            let logs = &self.log_weights[set * before..(set + 1) * before];
            linear_weights(logs, &mut weights);
            let keep = count == before
                && threshold.is_some_and(|share| effective_sample_size(&weights) >= share * before as f64);
            resampled.push(!keep);
            if keep {
                x.extend_from_slice(particles);
                log_weights.extend_from_slice(logs);
                continue;
            }
            let rng = self.rng(set, self.step, Purpose::Selection(self.selections));
            scheme.indices(&weights, count, &rng, &mut indices);
            if indices.len() != count {
                return Err(Error::argument("log_weights", "a weight above zero in every set", "none"));
            }
            for &i in &indices {
                x.extend_from_slice(&particles[i * n..(i + 1) * n]);
            }
            log_weights.resize(log_weights.len() + count, -(count as f64).ln());
        }
        (self.x, self.log_weights) = (x, log_weights);
        self.selections += 1;
        Ok(resampled)
    }
}
