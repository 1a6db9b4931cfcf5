//! What a covariance must be: finite, symmetric, positive definite. In single precision, products of an
//! almost singular matrix are not.

use super::covariance::PIXEL_RESULT;
use super::tile::TILE_COLUMNS;
use crate::flow::symmetric::{ENTRIES, upper};
use crate::simd::SimdReal;
use nalgebra::{Matrix6, SymmetricEigen};

/// Least eigenvalue of a covariance whose diagonal is 1.
const LEAST: f64 = 1e-5;

/// Mends the covariances of the first `count` pixels of a row that are not positive definite.
pub(super) fn mend_row<T: SimdReal>(scale: f64, pixel: &mut [T], count: usize) {
    for c in 0..count {
        let at = |k: usize| pixel[(PIXEL_RESULT + k) * TILE_COLUMNS + c].to_f64();
        let entries: [f64; ENTRIES] = std::array::from_fn(at);
        if entries.iter().all(|e| e.is_finite())
            && entries.iter().any(|e| *e != 0.0)
            && let Some(mended) = mend(&entries, scale)
        {
            for (k, entry) in mended.into_iter().enumerate() {
                pixel[(PIXEL_RESULT + k) * TILE_COLUMNS + c] = T::from_f64(entry);
            }
        }
    }
}

/// The nearest covariance that is positive definite beyond rounding, or nothing where this one is.
fn mend(entries: &[f64; ENTRIES], scale: f64) -> Option<[f64; ENTRIES]> {
    let entry = |i: usize, j: usize| entries[if i <= j { upper(i, j) } else { upper(j, i) }];
    // No variance may be less than rounding leaves of the largest, in one unit.
    let unit = |i: usize| if i < 2 { 1.0 } else { scale };
    let largest = (0..6).map(|i| entry(i, i) / unit(i).powi(2)).fold(0.0, f64::max);
    let deviation: [f64; 6] = std::array::from_fn(|i| entry(i, i).max(1e-12 * largest * unit(i).powi(2)).sqrt());
    let correlation =
        Matrix6::from_fn(
            |i, j| {
                if i == j { 1.0 } else { (entry(i, j) / (deviation[i] * deviation[j])).clamp(-1.0, 1.0) }
            },
        );
    if entry_positive(&entry) && is_definite(&correlation) {
        return None;
    }
    let mut eigen = SymmetricEigen::new(correlation);
    eigen.eigenvalues.iter_mut().for_each(|value| *value = value.max(LEAST));
    let sound = eigen.recompose();
    let mut mended = [0.0; ENTRIES];
    for i in 0..6 {
        for j in i..6 {
            mended[upper(i, j)] = sound[(i, j)] * deviation[i] * deviation[j];
        }
    }
    Some(mended)
}

fn entry_positive(entry: &impl Fn(usize, usize) -> f64) -> bool {
    (0..6).all(|i| entry(i, i) > 0.0)
}

/// Whether Cholesky's pivots all stay above half of [`LEAST`].
fn is_definite(correlation: &Matrix6<f64>) -> bool {
    let mut l = *correlation;
    for j in 0..6 {
        for k in 0..j {
            for i in j..6 {
                l[(i, j)] -= l[(i, k)] * l[(j, k)];
            }
        }
        if l[(j, j)] < 0.5 * LEAST || l[(j, j)].is_nan() {
            return false;
        }
        let root = l[(j, j)].sqrt();
        (j..6).for_each(|i| l[(i, j)] /= root);
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(of: impl Fn(usize, usize) -> f64) -> [f64; ENTRIES] {
        let mut list = [0.0; ENTRIES];
        (0..6).for_each(|i| (i..6).for_each(|j| list[upper(i, j)] = of(i, j)));
        list
    }

    #[test]
    fn only_what_is_not_definite_changes() {
        assert!(mend(&entries(|i, j| if i == j { 1.0 + i as f64 } else { 0.3 }), 0.25).is_none());
        // Rank one, and one of its variances lost to rounding.
        for lost in [0.0, -1e-9] {
            let a = [100.0, -99.0, 1e-3, 2e-3, -1e-3, 3e-3];
            let singular = entries(|i, j| if (i, j) == (2, 2) { lost } else { a[i] * a[j] });
            let mended = mend(&singular, 0.25).unwrap();
            let rounded =
                Matrix6::from_fn(|i, j| f64::from(mended[if i <= j { upper(i, j) } else { upper(j, i) }] as f32));
            assert!(rounded.cholesky().is_some(), "{lost}");
            assert!((mended[upper(0, 0)] / 1e4 - 1.0).abs() < 1e-3);
        }
    }
}
