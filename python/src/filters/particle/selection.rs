//! `resample`: a selection by itself.

use crate::errors::Outcome;
use crate::{arrays, image::renamed, options::Integer, options::count, options::named};
use jacoflow::error::{Error, check_memory, shape_text};
use jacoflow::filter::particle::{Resampling, resample_indices};
use jacoflow::math::random::CounterRng;
use pyo3::prelude::*;
use std::cell::Cell;

/// Indices (n,) of particles selected in proportion to `weights` (N,), which are not negative and need not
/// sum to 1, no unit.
///
/// `n` defaults to N. `scheme` is "systematic", "stratified", "residual" or "multinomial". A position t in
/// [0, 1] selects the first particle with a weight above zero whose cumulative weight is at least t times the
/// sum: (i + u) / n for i = 0 .. n - 1 with one u (systematic) or one each (stratified). Residual takes
/// floor(n w) copies of each first. `uniforms`, numbers in [0, 1], are used in their order; without them
/// those of `random_state` are. ValueError for other weights, or too few uniforms.
/// Source: R. Douc, O. Cappe, E. Moulines, "Comparison of resampling schemes for particle filtering", 2005.
#[pyfunction]
#[pyo3(signature = (weights, n=None, scheme="systematic", *, uniforms=None, random_state=None))]
pub fn resample<'py>(
    py: Python<'py>,
    weights: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = named::n)] n: Option<Integer>,
    #[pyo3(from_py_with = named::scheme)] scheme: &str,
    uniforms: Option<&Bound<'py, PyAny>>,
    #[pyo3(from_py_with = named::random_state)] random_state: Option<Integer>,
) -> Outcome<Bound<'py, PyAny>> {
    let scheme = Resampling::parse(scheme).map_err(|error| renamed(error, "resampling", "scheme"))?;
    let weights = checked_weights(weights)?;
    let number = n.map(|n| count("n", n)).transpose()?.unwrap_or(weights.len());
    check_memory("n", number.checked_mul(size_of::<usize>() + size_of::<i64>()))?;
    let mut indices = Vec::new();
    if let Some(uniforms) = uniforms {
        if random_state.is_some() {
            return Err(Error::argument("random_state", "none beside uniforms", "both").into());
        }
        let given = checked_uniforms(uniforms)?;
        // How many numbers residual resampling needs depends on the weights.
        let needed = Cell::new(0);
        let uniform = |i: u64| {
            needed.set(needed.get().max(i as usize + 1));
            given.get(i as usize).copied().unwrap_or(0.0)
        };
        resample_indices(scheme, &weights, number, uniform, &mut indices);
        if needed.get() > given.len() {
            let expected = format!("at least {} numbers", needed.get());
            return Err(Error::argument("uniforms", expected, given.len()).into());
        }
    } else {
        let rng = CounterRng::new(random_state.map(seed).transpose()?.unwrap_or(0));
        py.detach(|| scheme.indices(&weights, number, &rng, &mut indices));
    }
    let indices: Vec<i64> = indices.into_iter().map(|i| i as i64).collect();
    arrays::owned(py, &[number], indices)
}

/// `random_state`: an integer that is not negative.
pub(super) fn seed(value: Integer) -> Outcome<u64> {
    u64::try_from(value.0).map_err(|_| Error::argument("random_state", "an integer of at least 0", value).into())
}

fn checked_weights(object: &Bound<'_, PyAny>) -> Outcome<Vec<f64>> {
    let (shape, values) = arrays::doubles("weights", object)?;
    let refuse =
        |got: String| Err(Error::argument("weights", "finite numbers (N,), none below 0, one above 0", got).into());
    if shape.len() != 1 {
        return refuse(format!("shape {}", shape_text(&shape)));
    }
    if let Some(value) = values.iter().find(|v| !(v.is_finite() && **v >= 0.0)) {
        return refuse(value.to_string());
    }
    if values.iter().sum::<f64>() > 0.0 { Ok(values) } else { refuse("none above 0".into()) }
}

fn checked_uniforms(object: &Bound<'_, PyAny>) -> Outcome<Vec<f64>> {
    let (shape, values) = arrays::doubles("uniforms", object)?;
    let wrong = values.iter().find(|v| !(0.0..=1.0).contains(*v)).map(ToString::to_string);
    match wrong.or_else(|| (shape.len() > 1).then(|| format!("shape {}", shape_text(&shape)))) {
        Some(got) => Err(Error::argument("uniforms", "numbers from 0 to 1, shape (k,)", got).into()),
        None => Ok(values),
    }
}
