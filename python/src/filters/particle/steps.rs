//! Sampling, prediction, update, resampling.

use super::class::ParticleFilter;
use crate::arrays;
use crate::errors::Outcome;
use crate::filters::callback::{Callbacks, lead, lock};
use crate::image::renamed;
use crate::options::{Function, Integer, count, named};
use jacoflow::error::{Error, shape_text};
use jacoflow::filter::particle::{ParticleFilter as Core, Resampling};
use pyo3::prelude::*;

#[pymethods]
impl ParticleFilter {
    /// Marginal quantiles of every component at `q` in [0, 1]: array (n,) or (B, n), with the axis of `q`
    /// first if it is (k,), in the state's units.
    ///
    /// The smallest value at which the cumulative weight is at least q, numpy's method "inverted_cdf".
    fn quantile<'py>(&self, py: Python<'py>, q: &Bound<'py, PyAny>) -> Outcome<Bound<'py, PyAny>> {
        let (axes, levels) = arrays::doubles("q", q)?;
        if axes.len() > 1 {
            return Err(Error::argument("q", "a number or shape (k,)", format!("shape {}", shape_text(&axes))).into());
        }
        self.estimate(py, &axes, &[self.dim_x], |core| core.quantiles(&levels))
    }

    /// Replaces the particles by samples of the Gaussian with `mean` (n,) or (B, n) and `covariance` (n, n)
    /// or (B, n, n), in the state's units, and makes the weights equal. A number for `covariance` means that
    /// multiple of the identity.
    fn sample_gaussian(&self, py: Python<'_>, mean: &Bound<'_, PyAny>, covariance: &Bound<'_, PyAny>) -> Outcome<()> {
        let (shape, values) = arrays::doubles("mean", mean)?;
        let full = lead(self.batch, &[self.dim_x]);
        if shape != [self.dim_x] && shape != full {
            return Err(Error::shape("mean", &full, &shape).into());
        }
        let covariance = self.matrix("covariance", covariance)?;
        let mut core = lock(&self.core)?;
        self.give(py, &mut core)?;
        let work = &mut *core;
        py.detach(|| work.sample_gaussian(&values, &covariance))?;
        self.take(py, &mut core)
    }

    /// Moves every particle: x <- transition(x) + w or, without `transition`, x <- F x + w, w ~ N(0, Q).
    ///
    /// `transition` maps all particles (N, n) or (B, N, n) to as many, in the state's units. `F` (default:
    /// identity) and `Q` are (n, n) or (B, n, n); a number means that multiple of the identity. Without `Q`
    /// no noise is added: the transition must be random itself, e.g. by `standard_normal()`. ValueError for
    /// results that are not finite. On exceptions the filter is as before.
    #[pyo3(signature = (transition=None, *, F=None, Q=None))]
    fn predict(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = named::transition)] transition: Option<Function>,
        F: Option<&Bound<'_, PyAny>>,
        Q: Option<&Bound<'_, PyAny>>,
    ) -> Outcome<()> {
        if transition.is_some() && F.is_some() {
            return Err(Error::argument("F", "no matrix beside a transition", "both").into());
        }
        if transition.is_none() && F.is_none() && Q.is_none() {
            return Err(Error::argument("transition", "a function, or F or Q", "none of them").into());
        }
        let q = Q.map(|q| self.matrix("Q", q)).transpose()?;
        let f = F.map(|f| self.matrix("F", f)).transpose()?;
        let mut core = lock(&self.core)?;
        self.give(py, &mut core)?;
        let (n, callbacks, work) = (self.dim_x, Callbacks::default(), &mut *core);
        let shape = lead(self.batch, &[work.particles(), n]);
        let result = py.detach(|| {
            if let Some(function) = &transition {
                let step = |x: &[f64], next: &mut [f64]| {
                    callbacks.call("transition", &[(&shape, x)], &shape, next, |py, inputs| {
                        Ok(function.0.bind(py).call1((&inputs[0],))?)
                    })
                };
                return work.predict(step, q.as_deref());
            }
            let identity = || (0..n * n).map(|k| f64::from(u8::from(k % (n + 1) == 0))).collect();
            work.predict_linear(&f.unwrap_or_else(identity), &q.unwrap_or_else(|| vec![0.0; n * n]))
        });
        callbacks.finish(result)?;
        self.take(py, &mut core)
    }

    /// The standard normals of which the next prediction's noise is made, array (N, n) or (B, N, n), no unit.
    fn standard_normal<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        let tail = [self.n_particles(py)?, self.dim_x];
        self.estimate(py, &[], &tail, Core::standard_normal)
    }

    /// Multiplies the weights by the measurement's likelihood.
    ///
    /// `log_likelihood` maps all particles (N, n) or (B, N, n) to logarithms (N,) or (B, N), no unit, or is
    /// that array. NaN counts as -inf. A filter whose particles all have a likelihood of zero refuses the
    /// update: weights stay and `degenerate` counts it. ValueError for +inf. On exceptions the filter is as
    /// before.
    fn update(&self, py: Python<'_>, log_likelihood: &Bound<'_, PyAny>) -> Outcome<()> {
        let mut core = lock(&self.core)?;
        self.give(py, &mut core)?;
        let (callbacks, work) = (Callbacks::default(), &mut *core);
        let (shape, shape_out) =
            (lead(self.batch, &[work.particles(), self.dim_x]), lead(self.batch, &[work.particles()]));
        let result = if log_likelihood.is_callable() {
            let function = log_likelihood.clone().unbind();
            py.detach(|| {
                work.update(|x, out| {
                    callbacks.call("log_likelihood", &[(&shape, x)], &shape_out, out, |py, inputs| {
                        Ok(function.bind(py).call1((&inputs[0],))?)
                    })
                })
            })
        } else {
            let (shape, values) = arrays::doubles("log_likelihood", log_likelihood)?;
            if shape != shape_out {
                let [wanted, got] = [&shape_out, &shape].map(|axes| shape_text(axes));
                let expected = format!("a function or shape {wanted}");
                return Err(Error::argument("log_likelihood", expected, format!("shape {got}")).into());
            }
            py.detach(|| {
                work.update(|_, out| {
                    out.copy_from_slice(&values);
                    Ok(())
                })
            })
        };
        callbacks.finish(result)?;
        core.x = Vec::new();
        Ok(())
    }

    /// Copies particles in proportion to their weights, which are equal afterwards; returns whether, array ()
    /// or (B,) of bool, no unit.
    ///
    /// `scheme` is "systematic", "stratified", "residual" or "multinomial" (Douc, Cappe and Moulines 2005).
    /// With a `threshold` in [0, 1] only filters whose effective sample size is below `threshold` N are
    /// resampled. `n_particles` changes N, then in all filters.
    #[pyo3(signature = (scheme="systematic", *, threshold=None, n_particles=None))]
    fn resample<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = named::scheme)] scheme: &str,
        #[pyo3(from_py_with = named::threshold)] threshold: Option<f64>,
        #[pyo3(from_py_with = named::n_particles)] n_particles: Option<Integer>,
    ) -> Outcome<Bound<'py, PyAny>> {
        let scheme = Resampling::parse(scheme).map_err(|error| renamed(error, "resampling", "scheme"))?;
        let n_particles = n_particles.map(|number| count("n_particles", number)).transpose()?;
        let mut core = lock(&self.core)?;
        self.give(py, &mut core)?;
        let work = &mut *core;
        let resampled = py.detach(|| work.resample(scheme, threshold, n_particles))?;
        self.take(py, &mut core)?;
        arrays::owned(py, &lead(self.batch, &[]), resampled)
    }
}
