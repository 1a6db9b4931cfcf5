//! Dirichlet-process mixtures for Python; the class that a user meets is
//! `jacoflow.mixture.DirichletProcessGaussianMixture`.

use super::arrays;
use super::mixture::{Sample, count, covariance_prior, densities_and_shares, entry, numbers, shares};
use crate::errors::Outcome;
use crate::interrupt::interruptible;
use crate::options::{self, Integer, named};
use jacoflow::error::Error;
use jacoflow::mixture::{DirichletMixture, DirichletOptions, Inference, fit_dirichlet, fit_dirichlet_from};
use jacoflow::parallel::Threads;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyDictMethods};

/// The core's options from the parameters of the Python class.
fn options(from: &Bound<'_, PyDict>, dimensions: usize) -> Outcome<DirichletOptions> {
    let inference = match entry::<String>(from, "inference")?.as_str() {
        "map" => Inference::Map,
        "vb" => Inference::Vb,
        other => return Err(Error::argument("inference", "\"map\" or \"vb\"", format!("{other:?}")).into()),
    };
    Ok(DirichletOptions {
        n_components: count(from, "n_components")?,
        weight_concentration: entry(from, "weight_concentration")?,
        inference,
        merge: entry(from, "merge")?,
        mean_precision: entry(from, "mean_precision")?,
        degrees_of_freedom: entry(from, "degrees_of_freedom")?,
        covariance_prior: covariance_prior(from, dimensions)?,
        covariance_floor: entry(from, "covariance_floor")?,
        n_init: count(from, "n_init")?,
        max_iter: count(from, "max_iter")?,
        tol: entry(from, "tol")?,
        random_state: entry(from, "random_state")?,
        threads: Threads::new(entry(from, "threads")?)?,
    })
}

/// A mixture as a dictionary of arrays.
fn dictionary(py: Python<'_>, mixture: DirichletMixture) -> Outcome<Bound<'_, PyDict>> {
    let out = PyDict::new(py);
    let (k, d) = (mixture.components(), mixture.dimensions);
    out.set_item("n_active", mixture.n_active())?;
    let arrays: [(&str, &[usize], Vec<f64>); 5] = [
        ("weights", &[k], mixture.weights),
        ("log_factors", &[k], mixture.log_factors),
        ("means", &[k, d], mixture.means),
        ("covariances", &[k, d, d], mixture.covariances),
        ("counts", &[k], mixture.counts),
    ];
    for (name, shape, values) in arrays {
        out.set_item(name, arrays::owned(py, shape, values)?)?;
    }
    out.set_item("lower_bound", mixture.lower_bound)?;
    out.set_item("n_iter", mixture.n_iter)?;
    out.set_item("converged", mixture.converged)?;
    Ok(out)
}

/// A mixture from what [`dictionary`] returned.
fn mixture(from: &Bound<'_, PyDict>) -> Outcome<DirichletMixture> {
    let (shape, means) = arrays::doubles("means", &from.as_any().get_item("means")?)?;
    Ok(DirichletMixture {
        dimensions: shape.last().copied().unwrap_or(0),
        weights: numbers(from, "weights")?,
        log_factors: numbers(from, "log_factors")?,
        means,
        covariances: numbers(from, "covariances")?,
        counts: numbers(from, "counts")?,
        lower_bound: entry(from, "lower_bound")?,
        n_iter: entry(from, "n_iter")?,
        converged: entry(from, "converged")?,
    })
}

#[pyfunction]
#[pyo3(name = "_mixture_dirichlet_fit")]
pub fn mixture_dirichlet_fit<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    weights: Option<&Bound<'py, PyAny>>,
    parameters: &Bound<'py, PyDict>,
    responsibilities: Option<&Bound<'py, PyAny>>,
) -> Outcome<Bound<'py, PyDict>> {
    let sample = Sample::new(points, weights)?;
    let options = options(parameters, sample.dimensions)?;
    let shares = shares(responsibilities, options.n_components)?;
    let mixture = interruptible(py, || match &shares {
        Some(shares) => fit_dirichlet_from(&sample.points(), &options, shares),
        None => fit_dirichlet(&sample.points(), &options),
    })?;
    dictionary(py, mixture)
}

#[pyfunction]
#[pyo3(name = "_mixture_dirichlet_densities")]
pub fn mixture_dirichlet_densities<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    components: &Bound<'py, PyDict>,
    #[pyo3(from_py_with = named::threads)] threads: Option<Integer>,
) -> Outcome<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let sample = Sample::new(points, None)?;
    let mixture = mixture(components)?;
    let threads = options::threads(threads)?;
    let (sums, shares) = interruptible(py, || threads.install(|| mixture.log_densities(&sample.points())))?;
    densities_and_shares(py, sums, shares)
}
