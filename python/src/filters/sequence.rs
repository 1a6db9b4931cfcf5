//! What filtering and smoothing of whole sequences take and return.

use super::gaussian::GaussianFilter;
use crate::arrays;
use crate::errors::Outcome;
use jacoflow::error::{Error, check_memory, shape_text};
use jacoflow::filter::Smoothed;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyList;

/// An argument for each time.
type Items<'py> = Vec<Option<Bound<'py, PyAny>>>;

/// Least memory of an item of a sequence as an object of Python, bytes.
const ITEM_BYTES: usize = 64;

/// The items of a sequence. One that is longer than memory holds is refused: a view may have any length.
pub fn items<'py>(name: &str, sequence: &Bound<'py, PyAny>) -> Outcome<Vec<Bound<'py, PyAny>>> {
    let got = sequence.get_type().name()?;
    let length = sequence.len().unwrap_or(0);
    check_memory(name, length.checked_mul(ITEM_BYTES))?;
    let wrong = |_| PyTypeError::new_err(format!("{name}: expected a sequence, got {got}"));
    Ok(sequence.try_iter().map_err(wrong)?.collect::<PyResult<_>>()?)
}

/// An item for each of `times`; without the sequence, and where it holds None, none.
pub fn for_each_time<'py>(
    name: &'static str,
    sequence: Option<&Bound<'py, PyAny>>,
    times: usize,
) -> Outcome<Items<'py>> {
    let Some(sequence) = sequence else { return Ok(vec![None; times]) };
    let items = items(name, sequence)?;
    if items.len() != times {
        return Err(Error::argument(name, format!("one item for each of {times} times"), items.len()).into());
    }
    Ok(items.into_iter().map(|item| Some(item).filter(|item| !item.is_none())).collect())
}

/// Checks the items of a sequence before the first step; `check` refuses one by the name of the sequence.
pub fn check_each<'a, 'py: 'a, T>(
    items: impl IntoIterator<Item = &'a Bound<'py, PyAny>>,
    check: impl Fn(&Bound<'py, PyAny>) -> Outcome<T>,
) -> Outcome<()> {
    items.into_iter().try_for_each(|item| check(item).map(|_| ()))
}

/// Means and covariances, one after the other.
#[derive(Default)]
pub struct Record {
    times: usize,
    x: Vec<f64>,
    P: Vec<f64>,
}

impl Record {
    pub fn push(&mut self, py: Python<'_>, filter: &GaussianFilter) -> Outcome<()> {
        self.times += 1;
        self.x.extend(filter.read(py, 0)?);
        self.P.extend(filter.read(py, 1)?);
        Ok(())
    }

    /// Arrays `(T, ..., n)` and `(T, ..., n, n)`.
    pub fn arrays<'py>(self, py: Python<'py>, filter: &GaussianFilter) -> Outcome<[Bound<'py, PyAny>; 2]> {
        Ok([of_times(py, filter, self.times, 0, self.x)?, of_times(py, filter, self.times, 1, self.P)?])
    }
}

/// Means `Xs` and covariances `Ps` of as many times, and how many.
pub fn filtered(
    filter: &GaussianFilter,
    Xs: &Bound<'_, PyAny>,
    Ps: &Bound<'_, PyAny>,
) -> Outcome<(usize, Vec<f64>, Vec<f64>)> {
    let read = |name, index, value: &Bound<'_, PyAny>, times: Option<usize>| -> Outcome<(usize, Vec<f64>)> {
        let listed =
            if value.hasattr("__next__")? { Some(PyList::new(value.py(), items(name, value)?)?) } else { None };
        let (shape, values) = arrays::doubles(name, listed.as_ref().map_or(value, |list| list.as_any()))?;
        let one = filter.shape(index);
        // A list of no arrays says nothing of their shape.
        let shape = if shape == [0] { [&shape[..], &one[..]].concat() } else { shape };
        match shape.split_first() {
            Some((&count, tail)) if tail == one && times.is_none_or(|times| times == count) => Ok((count, values)),
            _ => {
                let times = times.map_or("T".to_owned(), |times| times.to_string());
                let [one, got] = [&one, &shape].map(|axes| shape_text(axes));
                let expected = format!("{times} arrays of shape {one}");
                Err(Error::argument(name, expected, format!("shape {got}")).into())
            }
        }
    };
    let (times, means) = read("Xs", 0, Xs, None)?;
    Ok((times, means, read("Ps", 1, Ps, Some(times))?.1))
}

/// `Qs` of each time: those given, else the filter's.
pub fn noises(filter: &GaussianFilter, Qs: Option<&Bound<'_, PyAny>>, times: usize) -> Outcome<Option<Vec<Vec<f64>>>> {
    let Some(Qs) = Qs else { return Ok(None) };
    let py = Qs.py();
    let noises = for_each_time("Qs", Some(Qs), times)?.into_iter().map(|item| match item {
        Some(Q) => Ok(arrays::doubles("Qs", filter.noise("Qs", 2, &Q)?.bind(py))?.1),
        None => filter.read(py, 2),
    });
    noises.collect::<Outcome<_>>().map(Some)
}

/// x, P, K and Pp as arrays `(T, ...)`.
pub fn smoothed<'py>(
    py: Python<'py>,
    filter: &GaussianFilter,
    times: usize,
    all: Smoothed,
) -> Outcome<[Bound<'py, PyAny>; 4]> {
    let Smoothed { x, P, K, Pp } = all;
    let array = |index, values| of_times(py, filter, times, index, values);
    Ok([array(0, x)?, array(1, P)?, array(1, K)?, array(1, Pp)?])
}

fn of_times<'py>(
    py: Python<'py>,
    filter: &GaussianFilter,
    times: usize,
    index: usize,
    values: Vec<f64>,
) -> Outcome<Bound<'py, PyAny>> {
    let shape: Vec<usize> = std::iter::once(times).chain(filter.shape(index)).collect();
    arrays::owned(py, &shape, values)
}
