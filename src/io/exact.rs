//! Samples of types that frames do not have, in those that hold them exactly.

use crate::error::{Error, Result};
use crate::types::LARGEST_EXACT_INTEGER;
use std::path::Path;

/// Samples in a wider type.
pub(crate) fn widened<I: Into<S>, S>(samples: Vec<I>) -> Vec<S> {
    samples.into_iter().map(Into::into).collect()
}

/// Integers of 64 bits as float64.
///
/// # Errors
/// [`Error::Format`] with the path for one beyond 2^53.
pub(crate) fn exact_doubles<I: Copy + Into<i128>>(path: &Path, samples: &[I]) -> Result<Vec<f64>> {
    let is_exact = |value: i128| value.unsigned_abs() <= u128::from(LARGEST_EXACT_INTEGER);
    let values: Option<Vec<f64>> =
        samples.iter().map(|&sample| Some(sample.into()).filter(|&value| is_exact(value)).map(|v| v as f64)).collect();
    values.ok_or_else(|| Error::format(path, "samples of 64 bits beyond 2^53, which float64 does not hold exactly"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_up_to_two_to_the_fifty_three_are_exact() {
        let path = Path::new("s.tif");
        assert_eq!(exact_doubles(path, &[-(1_i64 << 53), 3]).unwrap(), [-9_007_199_254_740_992.0, 3.0]);
        assert!(exact_doubles(path, &[(1_u64 << 53) + 1]).is_err());
        assert!(exact_doubles(path, &[i64::MIN]).is_err());
        assert_eq!(widened::<i16, f32>(vec![-7]), [-7.0]);
    }
}
