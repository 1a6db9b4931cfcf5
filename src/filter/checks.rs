//! What the filters refuse: dimensions, lengths and values of arrays.

use crate::error::{Error, Result};
use crate::math::dense::covariance_fault;

/// Largest dimension of a state or a measurement: one matrix of it takes 128 MiB.
pub(super) const LARGEST_DIMENSION: usize = 4096;

/// Refuses a dimension that no filter can have; `name` is the argument.
///
/// # Errors
/// [`Error::Argument`] when it is zero or above 4096.
pub fn check_dimension(name: &'static str, n: usize) -> Result<()> {
    if (1..=LARGEST_DIMENSION).contains(&n) {
        return Ok(());
    }
    Err(Error::argument(name, format!("an integer from 1 to {LARGEST_DIMENSION}"), n))
}

/// Refuses a number of states without the memory that an unscented step takes.
pub(super) fn check_batch(batch: usize, n: usize, m: usize) -> Result<()> {
    if batch == 0 {
        return Err(Error::argument("batch", "a positive integer", 0));
    }
    let one = 32 * n * n + 16 * n * m + 8 * m * m;
    let room = batch.checked_mul(one).map(|values| Vec::<f64>::new().try_reserve_exact(values));
    if matches!(room, Some(Ok(()))) {
        return Ok(());
    }
    let expected = format!("as many filters of {n} state and {m} measurement dimensions as memory holds");
    Err(Error::argument("batch", expected, batch))
}

/// Refuses a mean that is not finite.
///
/// # Errors
/// [`Error::Argument`] naming `x`.
pub fn check_mean(x: &[f64]) -> Result<()> {
    refuse("x", x, |v| !v.is_finite(), "finite numbers")
}

/// Refuses `(n, n)` matrices that are not finite, symmetric and positive semi-definite to rounding.
///
/// # Errors
/// [`Error::Argument`] naming `name` and what is wrong.
pub fn check_covariances(name: &'static str, values: &[f64], n: usize) -> Result<()> {
    match values.chunks_exact(n * n).find_map(|matrix| covariance_fault(matrix, n)) {
        Some(fault) => Err(Error::argument(name, "a symmetric positive semi-definite matrix of finite numbers", fault)),
        None => Ok(()),
    }
}

/// Refuses a measurement that is infinite; NaN stands for a missing one.
pub(super) fn check_measurement(z: &[f64]) -> Result<()> {
    refuse("z", z, f64::is_infinite, "finite numbers, or NaN where one is missing")
}

/// Refuses an array with an entry that is not finite.
pub(super) fn check_finite(name: &'static str, values: &[f64]) -> Result<()> {
    refuse(name, values, |v| !v.is_finite(), "finite numbers")
}

/// The part of `values` that belongs to `item`: `values` has `size` values for all, or `size` for each.
pub(super) fn shared(values: &[f64], item: usize, size: usize) -> &[f64] {
    let start = if values.len() == size { 0 } else { item * size };
    &values[start..start + size]
}

/// Refuses an array that has none of the allowed lengths.
pub(super) fn expect(name: &'static str, values: &[f64], lengths: &[usize]) -> Result<()> {
    if lengths.contains(&values.len()) {
        return Ok(());
    }
    let mut allowed: Vec<_> = lengths.iter().map(ToString::to_string).collect();
    allowed.dedup();
    Err(Error::argument(name, format!("{} values", allowed.join(" or ")), format!("{} values", values.len())))
}

/// Refuses a callback's result that holds NaN or infinity, which would spread silently.
pub(super) fn finite(name: &'static str, values: &[f64]) -> Result<()> {
    refuse(name, values, |v| !v.is_finite(), "a function with finite results")
}

fn refuse(name: &'static str, values: &[f64], is_wrong: fn(f64) -> bool, expected: &'static str) -> Result<()> {
    match values.iter().find(|v| is_wrong(**v)) {
        Some(value) => Err(Error::argument(name, expected, value)),
        None => Ok(()),
    }
}
