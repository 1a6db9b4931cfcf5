//! The class: its particles as a numpy array that the user may change in place, its making and its copies.

use super::selection::seed;
use crate::arrays;
use crate::errors::Outcome;
use crate::filters::callback::{entry, lead, lock, read, write};
use crate::options::{Integer, count, named, threads};
use jacoflow::error::Error;
use jacoflow::filter::check_mean;
use jacoflow::filter::particle::ParticleFilter as Core;
use pyo3::exceptions::{PyOverflowError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Mutex;

/// Particle filter: the posterior as N weighted samples, for any transition and any likelihood.
///
/// `dim_x` = n components, `n_particles` = N; `batch` = B runs B independent filters, every array then having
/// a leading axis (B, ...). A cycle is `predict`, `update`, `resample`. Weights are kept as logarithms.
/// Random numbers are addressed by (`random_state`, id, step, particle, component): results do not depend on
/// `threads`, and a filter of the batch is the same alone, given its number in `ids` (B,) (default 0 .. B -
/// 1). Particles are zero at first: use `sample_gaussian` or set `x`. Units are the state's own.
/// Source: N. Gordon, D. Salmond, A. Smith, "Novel approach to nonlinear/non-Gaussian Bayesian state
/// estimation", 1993.
#[pyclass(module = "jacoflow.filters", frozen)]
pub struct ParticleFilter {
    pub(super) batch: Option<usize>,
    pub(super) dim_x: usize,
    /// Its particles are in `x` between steps.
    pub(super) core: Mutex<Core>,
    pub(super) x: Mutex<Py<PyAny>>,
}

impl ParticleFilter {
    /// Shape `(B, N, n)` or `(N, n)` of the particles, by the array: a callback may read it while the core is
    /// locked.
    pub(super) fn shape(&self, py: Python<'_>) -> Outcome<Vec<usize>> {
        Ok(read(py, &self.x).bind(py).getattr("shape")?.extract()?)
    }

    /// Copies the particles, which the user may have changed, into the core.
    pub(super) fn give(&self, py: Python<'_>, core: &mut Core) -> Outcome<()> {
        let expected = lead(self.batch, &[core.particles(), self.dim_x]);
        core.x = particles(read(py, &self.x).bind(py), &expected)?;
        Ok(())
    }

    /// A new array with the core's particles; arrays handed out before keep their values.
    pub(super) fn take(&self, py: Python<'_>, core: &mut Core) -> Outcome<()> {
        let shape = lead(self.batch, &[core.particles(), self.dim_x]);
        write(&self.x, arrays::owned(py, &shape, std::mem::take(&mut core.x))?.unbind());
        Ok(())
    }

    /// An estimate with `tail` as its shape for each filter, after `axes` of its own.
    pub(super) fn estimate<'py>(
        &self,
        py: Python<'py>,
        axes: &[usize],
        tail: &[usize],
        function: impl FnOnce(&Core) -> jacoflow::Result<Vec<f64>> + Send,
    ) -> Outcome<Bound<'py, PyAny>> {
        let mut core = lock(&self.core)?;
        self.give(py, &mut core)?;
        let work = &*core;
        let values = py.detach(|| function(work))?;
        core.x = Vec::new();
        let shape: Vec<_> = axes.iter().copied().chain(lead(self.batch, tail)).collect();
        arrays::owned(py, &shape, values)
    }

    /// Numbers of each filter, `()` or `(B,)`.
    pub(super) fn numbers<'py, T: numpy::Element>(
        &self,
        py: Python<'py>,
        of: impl FnOnce(&Core) -> Vec<T>,
    ) -> Outcome<Bound<'py, PyAny>> {
        let values = of(&*lock(&self.core)?);
        arrays::owned(py, &lead(self.batch, &[]), values)
    }

    /// A matrix `(n, n)` or `(B, n, n)`; a number is that multiple of the identity.
    pub(super) fn matrix(&self, name: &'static str, value: &Bound<'_, PyAny>) -> Outcome<Vec<f64>> {
        let (n, (shape, values)) = (self.dim_x, arrays::doubles(name, value)?);
        if let (true, [scale]) = (shape.is_empty(), values.as_slice()) {
            return Ok((0..n * n).map(|k| if k % (n + 1) == 0 { *scale } else { 0.0 }).collect());
        }
        let full = lead(self.batch, &[n, n]);
        if shape != [n, n] && shape != full {
            return Err(Error::shape(name, &full, &shape).into());
        }
        Ok(values)
    }
}

/// Finite particles of the shape expected.
pub(super) fn particles(value: &Bound<'_, PyAny>, expected: &[usize]) -> Outcome<Vec<f64>> {
    let (shape, values) = arrays::doubles("x", value)?;
    if shape != expected {
        return Err(Error::shape("x", expected, &shape).into());
    }
    check_mean(&values)?;
    Ok(values)
}

/// An item of `ids`.
fn id(value: &Bound<'_, PyAny>) -> Outcome<u64> {
    value.extract().map_err(|error: PyErr| {
        if error.is_instance_of::<PyOverflowError>(value.py()) {
            return Error::argument("ids", "integers from 0 to 2^64 - 1", value).into();
        }
        if error.is_instance_of::<PyTypeError>(value.py()) {
            let got = arrays::kind_of(value);
            return PyTypeError::new_err(format!("ids: expected integers, got {got}")).into();
        }
        error.into()
    })
}

#[pymethods]
impl ParticleFilter {
    #[new]
    #[pyo3(signature = (dim_x, n_particles, *, batch=None, random_state=None, ids=None, threads=None))]
    fn new(
        py: Python<'_>,
        #[pyo3(from_py_with = named::dim_x)] dim_x: Integer,
        #[pyo3(from_py_with = named::n_particles)] n_particles: Integer,
        #[pyo3(from_py_with = named::batch)] batch: Option<Integer>,
        #[pyo3(from_py_with = named::random_state)] random_state: Option<Integer>,
        ids: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = named::threads)] threads: Option<Integer>,
    ) -> Outcome<Self> {
        let batch = batch.map(|batch| count("batch", batch)).transpose()?;
        let (dim_x, n_particles) = (count("dim_x", dim_x)?, count("n_particles", n_particles)?);
        let mut core =
            Core::new(batch.unwrap_or(1), n_particles, dim_x, random_state.map(seed).transpose()?.unwrap_or(0))?;
        core.threads = self::threads(threads)?;
        if let Some(ids) = ids {
            let wrong = |_| {
                PyTypeError::new_err(format!("ids: expected {} integers, got {}", core.batch, arrays::kind_of(ids)))
            };
            let count = ids.len().map_err(wrong)?;
            if count != core.batch {
                return Err(Error::argument("ids", format!("{} integers", core.batch), count).into());
            }
            core.targets = ids.try_iter()?.map(|item| id(&item?)).collect::<Outcome<_>>()?;
        }
        let filter = Self { batch, dim_x, core: Mutex::new(core), x: Mutex::new(py.None()) };
        filter.take(py, &mut *lock(&filter.core)?)?;
        Ok(filter)
    }

    fn __repr__(&self, py: Python<'_>) -> Outcome<String> {
        let batch = self.batch.map_or("None".to_owned(), |b| b.to_string());
        let (count, seed) = (self.n_particles(py)?, lock(&self.core)?.random_state);
        Ok(format!("ParticleFilter(dim_x={}, n_particles={count}, batch={batch}, random_state={seed})", self.dim_x))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Outcome<(Bound<'py, PyAny>, (Bound<'py, PyDict>,))> {
        let (py, this, state) = (slf.py(), slf.get(), PyDict::new(slf.py()));
        let core = lock(&this.core)?;
        let array = |values: &Vec<f64>| arrays::owned(py, &[values.len()], values.clone());
        state.set_item("arguments", (this.dim_x, core.particles(), this.batch, core.random_state))?;
        state.set_item("x", read(py, &this.x).bind(py).call_method0("copy")?)?;
        state.set_item("log_weights", array(&core.log_weights)?)?;
        state.set_item("evidence", (array(&core.log_evidence)?, array(&core.log_evidence_sum)?))?;
        state.set_item("counts", (core.degenerate.clone(), core.step, core.selections))?;
        state.set_item("ids", core.targets.clone())?;
        Ok((py.import("jacoflow._jacoflow")?.getattr("_restore_particle")?, (state,)))
    }
}

/// The inverse of `ParticleFilter.__reduce__`.
#[pyfunction(name = "_restore_particle")]
pub fn restore_particle<'py>(py: Python<'py>, state: &Bound<'py, PyDict>) -> Outcome<Bound<'py, ParticleFilter>> {
    let (dim_x, n_particles, batch, seed): (usize, usize, Option<usize>, u64) = entry(state, "arguments")?.extract()?;
    let mut core = Core::new(batch.unwrap_or(1), n_particles, dim_x, seed)?;
    let vector = |value: &Bound<'py, PyAny>, length: usize| -> Outcome<Vec<f64>> {
        let values = arrays::doubles("state", value)?.1;
        let wrong = || Error::argument("state", format!("{length} values"), values.len());
        if values.len() == length { Ok(values) } else { Err(wrong().into()) }
    };
    // Taken as they are: normalising once more would change their last bits.
    core.log_weights = vector(&entry(state, "log_weights")?, core.log_weights.len())?;
    let (evidence, sum): (Bound<'py, PyAny>, Bound<'py, PyAny>) = entry(state, "evidence")?.extract()?;
    (core.log_evidence, core.log_evidence_sum) = (vector(&evidence, core.batch)?, vector(&sum, core.batch)?);
    (core.degenerate, core.step, core.selections) = entry(state, "counts")?.extract()?;
    core.targets = entry(state, "ids")?.extract()?;
    core.x = particles(&entry(state, "x")?, &lead(batch, &[n_particles, dim_x]))?;
    let filter = ParticleFilter { batch, dim_x, core: Mutex::new(core), x: Mutex::new(py.None()) };
    filter.take(py, &mut *lock(&filter.core)?)?;
    Ok(Bound::new(py, filter)?)
}
