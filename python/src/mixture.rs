//! Weighted mixtures for Python; the class that a user meets is
//! `jacoflow.mixture.VariationalGaussianMixture`.

use super::arrays;
use crate::errors::Outcome;
use crate::interrupt::interruptible;
use crate::options::{self, Integer, named};
use jacoflow::error::{Error, shape_text};
use jacoflow::mixture::{
    CovariancePrior, Fit, MixtureOptions, Moments, Points, Posterior, Prior, Retained, Seeding, Start, fit, partial_fit,
};
use jacoflow::parallel::Threads;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyDictMethods};

/// An array of doubles with its shape.
type Array = (Vec<usize>, Vec<f64>);

/// An entry of a dictionary that the Python class made.
pub(super) fn entry<'py, T: for<'a> FromPyObject<'a, 'py, Error = PyErr>>(
    from: &Bound<'py, PyDict>,
    name: &str,
) -> Outcome<T> {
    Ok(from.as_any().get_item(name)?.extract()?)
}

/// An array of a dictionary.
pub(super) fn numbers(from: &Bound<'_, PyDict>, name: &'static str) -> Outcome<Vec<f64>> {
    Ok(arrays::doubles(name, &from.as_any().get_item(name)?)?.1)
}

/// An option that is an array or absent.
fn optional(from: &Bound<'_, PyDict>, name: &'static str) -> Outcome<Option<Array>> {
    let value = from.as_any().get_item(name)?;
    if value.is_none() { Ok(None) } else { arrays::doubles(name, &value).map(Some) }
}

/// A count: an integer, positive; which ones are too small the core says.
pub(super) fn count(from: &Bound<'_, PyDict>, name: &'static str) -> Outcome<usize> {
    let value: super::options::Integer = entry(from, name)?;
    usize::try_from(value.0).map_err(|_| Error::argument(name, "a positive integer", value).into())
}

/// The prior of covariances: nothing, a number or a matrix.
pub(super) fn covariance_prior(from: &Bound<'_, PyDict>, dimensions: usize) -> Outcome<CovariancePrior> {
    match optional(from, "covariance_prior")? {
        None => Ok(CovariancePrior::Data),
        Some((shape, values)) if shape.is_empty() => Ok(CovariancePrior::Isotropic(values[0])),
        Some((shape, values)) if shape == [dimensions, dimensions] => Ok(CovariancePrior::Full(values)),
        Some((shape, _)) => {
            let expected = format!("a number or a matrix ({dimensions}, {dimensions})");
            Err(Error::argument("covariance_prior", expected, format!("shape {}", shape_text(&shape))).into())
        }
    }
}

/// First responsibilities (N, K), if given.
pub(super) fn shares(given: Option<&Bound<'_, PyAny>>, components: usize) -> Outcome<Option<Vec<f64>>> {
    let Some((shape, shares)) = given.map(|shares| arrays::doubles("resp", shares)).transpose()? else {
        return Ok(None);
    };
    if shape.len() != 2 || shape[1] != components {
        let expected = format!("responsibilities (N, {components})");
        return Err(Error::argument("resp", expected, format!("shape {}", shape_text(&shape))).into());
    }
    Ok(Some(shares))
}

/// The core's options from the parameters of the Python class.
fn options(from: &Bound<'_, PyDict>, dimensions: usize) -> Outcome<MixtureOptions> {
    let seeding = match entry::<String>(from, "init")?.as_str() {
        "kmeans++" => Seeding::KMeans,
        "random" => Seeding::Random,
        other => return Err(Error::argument("init", "\"kmeans++\" or \"random\"", format!("{other:?}")).into()),
    };
    Ok(MixtureOptions {
        components: count(from, "n_components")?,
        weight_concentration_prior: entry(from, "weight_concentration_prior")?,
        mean_precision_prior: entry(from, "mean_precision_prior")?,
        mean_prior: optional(from, "mean_prior")?.map(|(_, values)| values),
        degrees_of_freedom_prior: entry(from, "degrees_of_freedom_prior")?,
        covariance_prior: covariance_prior(from, dimensions)?,
        max_iter: count(from, "max_iter")?,
        tol: entry(from, "tol")?,
        n_init: count(from, "n_init")?,
        seeding,
        prune_weight: entry(from, "prune_weight")?,
        random_state: entry(from, "random_state")?,
        threads: Threads::new(entry(from, "threads")?)?,
    })
}

/// Points (N, D) and their weights (N) as they came.
pub(super) struct Sample {
    pub dimensions: usize,
    values: Vec<f64>,
    weights: Option<Vec<f64>>,
}

impl Sample {
    pub fn new(x: &Bound<'_, PyAny>, weights: Option<&Bound<'_, PyAny>>) -> Outcome<Self> {
        let (shape, values) = arrays::doubles("X", x)?;
        let [_, dimensions] = shape[..] else {
            return Err(Error::argument("X", "points (N, D)", format!("shape {}", shape_text(&shape))).into());
        };
        let weights = weights.map(|weights| arrays::doubles("sample_weight", weights)).transpose()?;
        if let Some((shape, _)) = weights.as_ref().filter(|(shape, _)| shape.len() != 1) {
            return Err(Error::argument("sample_weight", "weights (N)", format!("shape {}", shape_text(shape))).into());
        }
        Ok(Self { dimensions, values, weights: weights.map(|(_, values)| values) })
    }

    pub fn points(&self) -> Points<'_> {
        Points { dimensions: self.dimensions, values: &self.values, weights: self.weights.as_deref() }
    }
}

/// Components from the arrays that [`fit_dict`] made.
fn posterior(from: &Bound<'_, PyDict>) -> Outcome<Posterior> {
    let means = arrays::doubles("means", &from.as_any().get_item("means")?)?;
    Ok(Posterior {
        dimensions: means.0.last().copied().unwrap_or(0),
        weight_concentration: numbers(from, "weight_concentration")?,
        mean_precision: numbers(from, "mean_precision")?,
        degrees_of_freedom: numbers(from, "degrees_of_freedom")?,
        means: means.1,
        scale_inverses: numbers(from, "scale_inverses")?,
    })
}

/// What earlier batches left, from the arrays that [`fit_dict`] made.
fn retained(from: &Bound<'_, PyDict>) -> Outcome<Retained> {
    let posterior = posterior(from)?;
    let prior = Prior {
        weight_concentration: entry(from, "prior_weight_concentration")?,
        mean_precision: entry(from, "prior_mean_precision")?,
        mean: numbers(from, "prior_mean")?,
        degrees_of_freedom: entry(from, "prior_degrees_of_freedom")?,
        scale_inverse: numbers(from, "prior_scale_inverse")?,
    };
    let moments = Moments {
        dimensions: posterior.dimensions,
        counts: numbers(from, "counts")?,
        means: numbers(from, "centroids")?,
        scatters: numbers(from, "scatters")?,
    };
    Ok(Retained { prior, posterior, moments, negentropy: entry(from, "negentropy")? })
}

/// A fit as a dictionary of arrays.
fn fit_dict(py: Python<'_>, fit: Fit) -> Outcome<Bound<'_, PyDict>> {
    let out = PyDict::new(py);
    let (k, d) = (fit.posterior.components(), fit.posterior.dimensions);
    let rounds = fit.lower_bounds.len();
    let precisions = fit.posterior.precisions()?;
    let arrays: [(&str, &[usize], Vec<f64>); 12] = [
        ("weight_concentration", &[k], fit.posterior.weight_concentration),
        ("mean_precision", &[k], fit.posterior.mean_precision),
        ("degrees_of_freedom", &[k], fit.posterior.degrees_of_freedom),
        ("means", &[k, d], fit.posterior.means),
        ("scale_inverses", &[k, d, d], fit.posterior.scale_inverses),
        ("precisions", &[k, d, d], precisions),
        ("counts", &[k], fit.moments.counts),
        ("centroids", &[k, d], fit.moments.means),
        ("scatters", &[k, d, d], fit.moments.scatters),
        ("lower_bounds", &[rounds], fit.lower_bounds),
        ("prior_mean", &[d], fit.prior.mean),
        ("prior_scale_inverse", &[d, d], fit.prior.scale_inverse),
    ];
    for (name, shape, values) in arrays {
        out.set_item(name, arrays::owned(py, shape, values)?)?;
    }
    out.set_item("prior_weight_concentration", fit.prior.weight_concentration)?;
    out.set_item("prior_mean_precision", fit.prior.mean_precision)?;
    out.set_item("prior_degrees_of_freedom", fit.prior.degrees_of_freedom)?;
    out.set_item("negentropy", fit.negentropy)?;
    out.set_item("converged", fit.converged)?;
    Ok(out)
}

#[pyfunction]
#[pyo3(name = "_mixture_fit")]
pub fn mixture_fit<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    weights: Option<&Bound<'py, PyAny>>,
    parameters: &Bound<'py, PyDict>,
    responsibilities: Option<&Bound<'py, PyAny>>,
    start: Option<&Bound<'py, PyDict>>,
) -> Outcome<Bound<'py, PyDict>> {
    let sample = Sample::new(points, weights)?;
    let options = options(parameters, sample.dimensions)?;
    let shares = shares(responsibilities, options.components)?;
    let components = start.map(posterior).transpose()?;
    let result = interruptible(py, || {
        let start = match (&shares, &components) {
            (Some(shares), _) => Start::Responsibilities(shares),
            (None, Some(components)) => Start::Components(components),
            (None, None) => Start::Seeds,
        };
        fit(&sample.points(), &options, start)
    })?;
    fit_dict(py, result)
}

#[pyfunction]
#[pyo3(name = "_mixture_partial_fit")]
pub fn mixture_partial_fit<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    weights: Option<&Bound<'py, PyAny>>,
    parameters: &Bound<'py, PyDict>,
    earlier: Option<&Bound<'py, PyDict>>,
    forgetting: f64,
) -> Outcome<Bound<'py, PyDict>> {
    let sample = Sample::new(points, weights)?;
    let options = options(parameters, sample.dimensions)?;
    let earlier = earlier.map(retained).transpose()?;
    let result = interruptible(py, || partial_fit(&sample.points(), &options, earlier.as_ref(), forgetting))?;
    fit_dict(py, result)
}

#[pyfunction]
#[pyo3(name = "_mixture_densities")]
pub fn mixture_densities<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    components: &Bound<'py, PyDict>,
    #[pyo3(from_py_with = named::threads)] threads: Option<Integer>,
) -> Outcome<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let sample = Sample::new(points, None)?;
    let components = posterior(components)?;
    let threads = options::threads(threads)?;
    let (sums, shares) = interruptible(py, || threads.install(|| components.log_densities(&sample.points())))?;
    densities_and_shares(py, sums, shares)
}

/// Log densities (N,) and responsibilities (N, K).
pub(super) fn densities_and_shares(
    py: Python<'_>,
    sums: Vec<f64>,
    shares: Vec<f64>,
) -> Outcome<(Bound<'_, PyAny>, Bound<'_, PyAny>)> {
    let shape = [sums.len(), shares.len() / sums.len().max(1)];
    let shares = arrays::owned(py, &shape, shares)?;
    Ok((arrays::owned(py, &shape[..1], sums)?, shares.into_any()))
}
