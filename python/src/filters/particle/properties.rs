//! Particles, weights, estimates and counts.

use super::{class::ParticleFilter, class::particles};
use crate::arrays;
use crate::errors::Outcome;
use crate::filters::callback::{lead, lock, read, write};
use crate::keywords::getters;
use jacoflow::error::Error;
use jacoflow::filter::particle::ParticleFilter as Core;
use pyo3::prelude::*;

getters! {
    ParticleFilter;
    /// Particles, array (N, n) or (B, N, n), in the state's units; may be replaced or changed in place.
    x(this, slf) -> Py<PyAny> = read(slf.py(), &this.x);
    /// Logarithms of the normalised weights, read-only array (N,) or (B, N), no unit. Normalised when set;
    /// NaN counts as -inf.
    log_weights(this, slf) -> Outcome<Bound<'py, PyAny>> = {
        let core = lock(&this.core)?;
        let shape = lead(this.batch, &[core.particles()]);
        let array = arrays::owned(slf.py(), &shape, core.log_weights.clone())?;
        array.getattr("flags")?.setattr("writeable", false)?;
        Ok(array)
    };
    /// Weights, which sum to 1, array (N,) or (B, N), no unit.
    weights(this, slf) -> Outcome<Bound<'py, PyAny>> = {
        let core = lock(&this.core)?;
        let values = core.log_weights.iter().map(|log| log.exp()).collect();
        arrays::owned(slf.py(), &lead(this.batch, &[core.particles()]), values)
    };
    /// Weighted mean, array (n,) or (B, n), in the state's units.
    mean(this, slf) -> Outcome<Bound<'py, PyAny>> = this.estimate(slf.py(), &[], &[this.dim_x], Core::mean);
    /// filterpy's name of `covariance`, array (n, n) or (B, n, n), in the state's units squared.
    P(this, slf) -> Outcome<Bound<'py, PyAny>> = this.covariance(slf.py());
    /// The particle with the largest weight, array (n,) or (B, n), in the state's units.
    ///
    /// Read it before `resample`: afterwards all weights are equal, and it is the first particle.
    map(this, slf) -> Outcome<Bound<'py, PyAny>> = this.estimate(slf.py(), &[], &[this.dim_x], Core::map);
    /// Effective sample size 1 / sum w^2 (Kong, Liu and Wong 1994), array () or (B,), a number of particles
    /// from 1 to N, no unit.
    effective_sample_size(this, slf) -> Outcome<Bound<'py, PyAny>> = this.estimate(slf.py(), &[], &[], Core::effective_sample_size);
    /// Logarithm of the last measurement's likelihood, log sum w_i L_i, array () or (B,), no unit; -inf if
    /// the update was refused.
    log_evidence(this, slf) -> Outcome<Bound<'py, PyAny>> = this.numbers(slf.py(), |core| core.log_evidence.clone());
    /// Sum of `log_evidence` over the accepted updates, array () or (B,), no unit.
    log_evidence_sum(this, slf) -> Outcome<Bound<'py, PyAny>> = this.numbers(slf.py(), |core| core.log_evidence_sum.clone());
    /// Number of updates refused because no particle had a likelihood above zero, array () or (B,) (a count,
    /// no unit).
    degenerate(this, slf) -> Outcome<Bound<'py, PyAny>> = this.numbers(slf.py(), |core| core.degenerate.iter().map(|&count| count as i64).collect());
    /// Numbers by which the random numbers of each filter are addressed, array () or (B,), no unit.
    ids(this, slf) -> Outcome<Bound<'py, PyAny>> = this.numbers(slf.py(), |core| core.targets.clone());
    /// Number of predictions so far (a count, no unit).
    step(this) -> Outcome<u64> = Ok(lock(&this.core)?.step);
    /// Components n of the state (a count, no unit).
    dim_x(this) -> usize = this.dim_x;
    /// Number B of independent filters, or None where arrays have no leading axis (a count, no unit).
    batch(this) -> Option<usize> = this.batch;
}

#[pymethods]
impl ParticleFilter {
    #[setter]
    fn set_x(&self, value: &Bound<'_, PyAny>) -> Outcome<()> {
        let shape = self.shape(value.py())?;
        let values = particles(value, &shape)?;
        write(&self.x, arrays::owned(value.py(), &shape, values)?.unbind());
        Ok(())
    }
    #[setter]
    fn set_log_weights(&self, value: &Bound<'_, PyAny>) -> Outcome<()> {
        let (shape, values) = arrays::doubles("log_weights", value)?;
        let mut core = lock(&self.core)?;
        let expected = lead(self.batch, &[core.particles()]);
        if shape != expected {
            return Err(Error::shape("log_weights", &expected, &shape).into());
        }
        Ok(core.set_log_weights(&values)?)
    }
    /// Weighted covariance sum w (x - mean)(x - mean)^T, array (n, n) or (B, n, n), in the state's units
    /// squared.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        self.estimate(py, &[], &[self.dim_x; 2], Core::covariance)
    }
    /// Number N of particles of each filter (a count, no unit).
    #[getter]
    pub(super) fn n_particles(&self, py: Python<'_>) -> Outcome<usize> {
        let shape = self.shape(py)?;
        Ok(shape[shape.len() - 2])
    }
}
