//! Second moments of propagated points, tile by tile so that sums stay in registers.

use super::{N, PACKED, packed};
use crate::simd::Lanes;

/// `scale sum_k v_k v_k^T` into the brightness block of a packed covariance.
#[inline(always)]
pub(super) fn outer<V: Lanes>(vectors: &[[V; 6]], scale: V, cov: &mut [V; PACKED]) {
    let (mut upper, mut middle, mut lower) = ([V::zero(); 6], [V::zero(); 9], [V::zero(); 6]);
    for v in vectors {
        for (k, (a, b)) in TRIANGLE.into_iter().enumerate() {
            upper[k] = v[a].mul_add(v[b], upper[k]);
        }
    }
    for v in vectors {
        for k in 0..9 {
            middle[k] = v[3 + k / 3].mul_add(v[k % 3], middle[k]);
        }
    }
    for v in vectors {
        for (k, (a, b)) in TRIANGLE.into_iter().enumerate() {
            lower[k] = v[3 + a].mul_add(v[3 + b], lower[k]);
        }
    }
    for (k, (a, b)) in TRIANGLE.into_iter().enumerate() {
        cov[packed(a, b)] = upper[k] * scale;
        cov[packed(3 + a, 3 + b)] = lower[k] * scale;
    }
    for k in 0..9 {
        cov[packed(3 + k / 3, k % 3)] = middle[k] * scale;
    }
}

/// The lower triangle of a 3 x 3 tile.
pub(super) const TRIANGLE: [(usize, usize); 6] = [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)];

/// `scale sum_k d_k l_k^T` into the block of motion with brightness, `l_k` being the motion part of the
/// factor's column `k`.
#[inline(always)]
pub(super) fn cross<V: Lanes>(differences: &[[V; 6]], columns: &[[V; N]], scale: V, cov: &mut [V; PACKED]) {
    for m in 0..3 {
        for half in 0..2 {
            let mut sums = [V::zero(); 6];
            for (d, l) in differences.iter().zip(columns) {
                for k in 0..6 {
                    sums[k] = d[3 * half + k % 3].mul_add(l[6 + 2 * m + k / 3], sums[k]);
                }
            }
            for k in 0..6 {
                cov[packed(6 + 2 * m + k / 3, 3 * half + k % 3)] = sums[k] * scale;
            }
        }
    }
}
