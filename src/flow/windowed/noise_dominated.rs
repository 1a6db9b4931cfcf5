//! Inflates the covariance along directions of the motion that only noise determines.
//!
//! Noise has gradients of its own. On average it adds E to the normal matrix N, so that along an eigenvector
//! of `N^-1 E` with eigenvalue a the estimate is `1 - a` of the motion: where the image has no structure (an
//! edge's own direction, a grating), a is near 1 and the estimate near zero for every motion. What such
//! an estimate leaves open is as large as the spread of the one that undoes the attenuation, `1 / (1 - a)`
//! times as wide.

use super::noise::PixelNoise;
use super::sandwich::{PIXEL_RESULT, PIXEL_SHARE, noise_entry};
use super::tile::TILE_COLUMNS;
use crate::flow::symmetric::{ENTRIES, upper};
use crate::simd::SimdReal;
use nalgebra::{Matrix6, SymmetricEigen};

/// Noise in no direction exceeds this share of the equations where the shares add up to less.
const MIN_TOTAL_SHARE: f64 = 0.5;
/// Floor of `1 - share`: closer to 1, shares are rounding errors.
const MIN_SIGNAL_SHARE: f64 = 1e-2;

/// Widens the covariances of the first `count` pixels of a row where noise holds a notable share.
pub(super) fn inflate_row<T: SimdReal>(noise: &PixelNoise, scale: f64, pixel: &mut [T], count: usize) {
    for c in 0..count {
        let share = pixel[PIXEL_SHARE * TILE_COLUMNS + c].to_f64();
        if share > MIN_TOTAL_SHARE && share.is_finite() {
            inflate(noise, scale, pixel, c);
        }
    }
}

fn inflate<T: SimdReal>(noise: &PixelNoise, scale: f64, pixel: &mut [T], c: usize) {
    let at = |k: usize| pixel[k * TILE_COLUMNS + c].to_f64();
    let matrix = |first: usize| Matrix6::from_fn(|i, j| at(first + if i <= j { upper(i, j) } else { upper(j, i) }));
    let ones: [f64; 6] = std::array::from_fn(|k| at(ENTRIES + 8 + k));
    let variance = at(PIXEL_SHARE + 1);
    let added = Matrix6::from_fn(|i, j| variance * noise_entry::<f64>(&noise.quadratic, &ones, (i, j)));
    let Some(root) = matrix(0).cholesky() else { return };
    let root = root.l();
    let Some(back) = root.try_inverse() else { return };
    // N^-1 E is similar to the symmetric L^T E L, N^-1 = L L^T.
    let shares = SymmetricEigen::new(root.transpose() * added * root);
    let unit = Matrix6::from_diagonal(&[1.0, 1.0, scale, scale, scale, scale].into());
    let Some(unit_back) = unit.try_inverse() else { return };
    let gain = Matrix6::from_diagonal(&shares.eigenvalues.map(excess));
    let way = unit * root * shares.eigenvectors;
    let spread = way * gain * shares.eigenvectors.transpose() * back * unit_back;
    let covariance = matrix(PIXEL_RESULT);
    let wider = covariance + spread * covariance * spread.transpose();
    for i in 0..6 {
        for j in i..6 {
            pixel[(PIXEL_RESULT + upper(i, j)) * TILE_COLUMNS + c] = T::from_f64(wider[(i, j)]);
        }
    }
}

/// By how much undoing an attenuation of `1 - a` widens the estimate beyond what small shares do, which the
/// covariance holds as a pull: `a^4 / (1 - a)`.
fn excess(share: f64) -> f64 {
    let a = share.max(0.0);
    a.min(1.0).powi(4) / (1.0 - a).max(MIN_SIGNAL_SHARE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_noise_dominates_is_widened() {
        assert!(excess(0.1) < 2e-4 && excess(-0.2) == 0.0);
        assert!(excess(0.95) > 15.0);
        assert!(excess(1.0) > 90.0 && excess(3.0) > 90.0);
    }
}
