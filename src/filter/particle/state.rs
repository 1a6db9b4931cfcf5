//! A batch of weighted particle sets.

use super::{noise::roots, weights::normalise_log_weights};
use crate::error::{Error, Result};
use crate::filter::checks::{check_covariances, check_dimension, check_mean, expect, shared};
use crate::math::{dense::multiply_transposed, random::CounterRng};
use crate::parallel::{Threads, for_each_band_of};
use std::ops::Range;

/// `B` independent particle sets of `N` particles with `n` components each. Row-major arrays.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ParticleFilter {
    /// `B`, the number of sets.
    pub batch: usize,
    /// `n`, components of the state.
    pub dim_x: usize,
    /// Particles `(B, N, n)`; zero at first.
    pub x: Vec<f64>,
    /// Logarithms of the normalised weights `(B, N)`; `-ln N` at first.
    pub log_weights: Vec<f64>,
    /// Log evidence `log sum_i w_i L_i` of the last update, `(B)`; 0 at first, `-inf` where refused.
    pub log_evidence: Vec<f64>,
    /// Sum of the log evidence over the accepted updates, `(B)`.
    pub log_evidence_sum: Vec<f64>,
    /// Number of updates that were refused because no particle had a likelihood above zero, `(B)`.
    pub degenerate: Vec<u64>,
    /// Identifier of each set in the random numbers, `(B)`; 0, 1, ... at first.
    pub targets: Vec<u64>,
    /// Seed of the random numbers.
    pub random_state: u64,
    /// Number of predictions so far.
    pub step: u64,
    /// Number of selections since the last prediction: each has random numbers of its own.
    pub selections: u64,
    /// Number of threads; results do not depend on it.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub threads: Threads,
}

/// What random numbers of one step are for; selections follow.
#[derive(Clone, Copy)]
pub(super) enum Purpose {
    Start,
    Transition,
    Selection(u64),
}

/// Particles of one task. Fixed, so that the split never depends on the number of threads.
const BAND: usize = 1024;
/// Values up to which the caller's thread works alone: waking others takes longer.
const SERIAL: usize = 1 << 14;
/// Largest number of particles in one set.
const LARGEST_COUNT: usize = 1 << 32;

impl ParticleFilter {
    /// `batch` sets of `particles` particles with `dim_x` components, all zero, of equal weights.
    ///
    /// # Errors
    /// [`Error::Argument`] when a size is zero, when `dim_x` is above 4096, or when there is no memory for
    /// the particles.
    pub fn new(batch: usize, particles: usize, dim_x: usize, seed: u64) -> Result<Self> {
        check_dimension("dim_x", dim_x)?;
        if batch == 0 {
            return Err(Error::argument("batch", "a positive integer", 0));
        }
        check_count(batch, particles, dim_x)?;
        Ok(Self {
            batch,
            dim_x,
            x: vec![0.0; batch * particles * dim_x],
            log_weights: vec![-(particles as f64).ln(); batch * particles],
            log_evidence: vec![0.0; batch],
            log_evidence_sum: vec![0.0; batch],
            degenerate: vec![0; batch],
            targets: (0..batch as u64).collect(),
            random_state: seed,
            step: 0,
            selections: 0,
            threads: Threads::default(),
        })
    }

    /// `N`, particles in each set.
    pub fn particles(&self) -> usize {
        self.log_weights.len() / self.batch
    }

    /// Replaces the log weights `(B, N)` and normalises them; NaN counts as `-inf`.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `log_weights` for a wrong number of values, or a set without a weight above
    /// zero or with an infinite one.
    pub fn set_log_weights(&mut self, log_weights: &[f64]) -> Result<()> {
        expect("log_weights", log_weights, &[self.log_weights.len()])?;
        let mut normalised = log_weights.to_vec();
        for set in normalised.chunks_exact_mut(self.particles()) {
            if normalise_log_weights(set).is_none() {
                let largest = set.iter().copied().fold(f64::NAN, f64::max);
                return Err(Error::argument("log_weights", "a finite largest value in every set", largest));
            }
        }
        self.log_weights = normalised;
        Ok(())
    }

    /// Replaces the particles by samples of the Gaussian with `mean` `(n)` or `(B, n)` and `covariance`
    /// `(n, n)` or `(B, n, n)`, of equal weights.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `mean` or `covariance` for wrong sizes, values that are not finite, or no
    /// covariance.
    pub fn sample_gaussian(&mut self, mean: &[f64], covariance: &[f64]) -> Result<()> {
        let (b, n) = (self.batch, self.dim_x);
        expect("mean", mean, &[n, b * n])?;
        expect("covariance", covariance, &[n * n, b * n * n])?;
        if let Some(value) = mean.iter().find(|v| !v.is_finite()) {
            return Err(Error::argument("mean", "finite numbers", value));
        }
        check_covariances("covariance", covariance, n)?;
        let roots = roots(covariance, n);
        let mut samples = vec![0.0; self.x.len()];
        self.for_each_particle(Purpose::Start, &mut samples, |set, _, normal, sample| {
            multiply_transposed(normal, shared(&roots, set, n * n), n, sample);
            sample.iter_mut().zip(shared(mean, set, n)).for_each(|(sample, mean)| *sample += mean);
        });
        self.x = samples;
        let equal = -(self.particles() as f64).ln();
        self.log_weights.fill(equal);
        Ok(())
    }

    /// Random numbers of one set in this step.
    pub(super) fn rng(&self, set: usize, step: u64, purpose: Purpose) -> CounterRng {
        let purpose = match purpose {
            Purpose::Start => 0,
            Purpose::Transition => 1,
            Purpose::Selection(number) => 2 + number,
        };
        CounterRng::new(self.random_state).stream(self.targets[set]).stream(step).stream(purpose)
    }

    /// Calls `work(set, row of (B, N), standard normals (n), output (n))` for every particle.
    pub(super) fn for_each_particle(
        &self,
        purpose: Purpose,
        out: &mut [f64],
        work: impl Fn(usize, usize, &[f64], &mut [f64]) + Sync,
    ) {
        let (n, particles) = (self.dim_x, self.particles());
        let step = self.step + u64::from(matches!(purpose, Purpose::Transition));
        let streams: Vec<_> = (0..self.batch).map(|set| self.rng(set, step, purpose)).collect();
        self.for_each_row(n, out, |rows, out| {
            let mut normal = vec![0.0; n];
            for (row, out) in rows.zip(out.chunks_exact_mut(n)) {
                let (set, particle) = (row / particles, row % particles);
                streams[set].fill_normal((particle * n) as u64, &mut normal);
                work(set, row, &normal, out);
            }
        });
    }

    /// Calls `work(rows, their part of out)` for bands of the rows of `out`, which have `width` values each.
    pub(super) fn for_each_row(
        &self,
        width: usize,
        out: &mut [f64],
        work: impl Fn(Range<usize>, &mut [f64]) + Sync + Send,
    ) {
        if out.len() <= SERIAL || self.threads.count() == 1 {
            work(0..out.len() / width, out);
        } else {
            self.threads.install(|| for_each_band_of(BAND, out, width, |_, rows, out| work(rows, out)));
        }
    }

    /// Checks the public arrays, which a caller may have replaced.
    pub(super) fn check(&self) -> Result<()> {
        let b = self.batch;
        if self.log_weights.is_empty() || !self.log_weights.len().is_multiple_of(b) {
            let expected = format!("a positive multiple of {b} values");
            return Err(Error::argument("log_weights", expected, format!("{} values", self.log_weights.len())));
        }
        expect("x", &self.x, &[self.log_weights.len() * self.dim_x])?;
        if self.targets.len() != b {
            let got = format!("{} values", self.targets.len());
            return Err(Error::argument("targets", format!("{b} values"), got));
        }
        check_mean(&self.x)
    }
}

/// Refuses a number of particles for which there is no memory.
pub(super) fn check_count(batch: usize, particles: usize, dim_x: usize) -> Result<()> {
    if particles == 0 || particles > LARGEST_COUNT {
        return Err(Error::argument("n_particles", format!("an integer from 1 to {LARGEST_COUNT}"), particles));
    }
    // Particles, their successors, weights and likelihoods.
    let values = particles.checked_mul(2 * dim_x + 3).and_then(|one| one.checked_mul(batch));
    if matches!(values.map(|values| Vec::<f64>::new().try_reserve_exact(values)), Some(Ok(()))) {
        return Ok(());
    }
    let expected = format!("as many particles of {dim_x} components in {batch} sets as memory holds");
    Err(Error::argument("n_particles", expected, particles))
}
