//! Update: weights are multiplied by the likelihood of the measurement.

use super::{state::ParticleFilter, weights::normalise_log_weights};
use crate::error::{Error, Result};

impl ParticleFilter {
    /// Adds `log_likelihood(x, out)`, arrays `(B, N, n)` and `(B, N)`, to the log weights, normalised.
    ///
    /// NaN counts as `-inf`, a likelihood of zero. A set in which no particle is left with a weight above
    /// zero refuses the update: its weights and its sum of log evidence stay, `log_evidence` is `-inf` and
    /// `degenerate` counts it.
    ///
    /// # Errors
    /// The function's own, or [`Error::Argument`] naming `log_likelihood` for `+inf`. Nothing is then
    /// changed.
    pub fn update(&mut self, log_likelihood: impl FnOnce(&[f64], &mut [f64]) -> Result<()>) -> Result<()> {
        self.check()?;
        let mut posterior = vec![0.0; self.log_weights.len()];
        log_likelihood(&self.x, &mut posterior)?;
        if posterior.contains(&f64::INFINITY) {
            return Err(Error::argument("log_likelihood", "a function with results below infinity", f64::INFINITY));
        }
        let count = self.particles();
        let sets = posterior.chunks_exact_mut(count).zip(self.log_weights.chunks_exact_mut(count));
        for (set, (posterior, prior)) in sets.enumerate() {
            posterior.iter_mut().zip(&*prior).for_each(|(posterior, prior)| *posterior += prior);
            if let Some(evidence) = normalise_log_weights(posterior) {
                prior.copy_from_slice(posterior);
                self.log_evidence[set] = evidence;
                self.log_evidence_sum[set] += evidence;
            } else {
                self.log_evidence[set] = f64::NEG_INFINITY;
                self.degenerate[set] += 1;
            }
        }
        Ok(())
    }
}
