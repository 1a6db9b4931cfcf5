//! The condition number of the column-scaled equations, in lanes: cyclic Jacobi on their correlation matrix,
//! whose eigenvalues are squared singular values.

use crate::math::Real;
use crate::simd::{Lanes, SimdReal};

/// Sweeps after which what is left beside the diagonal is rounding; convergence is quadratic (J. Wilkinson
/// 1962).
fn sweeps<T: Real>() -> usize {
    if size_of::<T>() == 4 { 5 } else { 7 }
}

/// Smallest eigenvalue, of a trace of 6, that keeps two digits or more.
fn least_eigenvalue<T: Real>() -> f64 {
    if size_of::<T>() == 4 { 1e-4 } else { 1e-12 }
}

/// Largest over smallest singular value, from the upper triangle of the normal matrix; and whether (positive)
/// to trust it.
#[inline(always)]
pub(super) fn condition<T: SimdReal, V: Lanes<Scalar = T>>(normal: &[V; 21]) -> (V, V) {
    let mut a = correlation(normal);
    for _ in 0..sweeps::<T>() {
        for p in 0..5 {
            for q in p + 1..6 {
                rotate(&mut a, p, q);
            }
        }
    }
    let (mut least, mut most) = (a[0][0], a[0][0]);
    for (k, row) in a.iter().enumerate() {
        least = least.min(row[k]);
        most = most.max(row[k]);
    }
    ((most / least).sqrt(), least - V::constant(least_eigenvalue::<T>()))
}

/// The normal matrix scaled to a unit diagonal.
#[inline(always)]
fn correlation<V: Lanes>(normal: &[V; 21]) -> [[V; 6]; 6] {
    const DIAGONAL: [usize; 6] = [0, 6, 11, 15, 18, 20];
    let one = V::constant(1.0);
    let mut scale = [one; 6];
    for k in 0..6 {
        scale[k] = one / normal[DIAGONAL[k]].sqrt();
    }
    let mut a = [[one; 6]; 6];
    for i in 0..5 {
        for j in i + 1..6 {
            a[i][j] = normal[DIAGONAL[i] + j - i] * (scale[i] * scale[j]);
            a[j][i] = a[i][j];
        }
    }
    a
}

/// Turns columns and rows p and q so that their common entry becomes zero.
#[inline(always)]
fn rotate<V: Lanes>(a: &mut [[V; 6]; 6], p: usize, q: usize) {
    let (zero, one) = (V::zero(), V::constant(1.0));
    let (h, g) = (a[q][q] - a[p][p], a[p][q] + a[p][q]);
    let reach = h.max(-h) + h.mul_add(h, g * g).sqrt();
    // Where nothing is to be turned the divisor would be zero.
    let t = V::select(h.lt(zero), -g, g) / reach.max(V::constant(1e-30));
    let c = one / t.mul_add(t, one).sqrt();
    let s = t * c;
    for r in 0..6 {
        let (x, y) = (a[r][p], a[r][q]);
        a[r][p] = s.neg_mul_add(y, c * x);
        a[r][q] = s.mul_add(x, c * y);
    }
    for r in 0..6 {
        let (x, y) = (a[p][r], a[q][r]);
        a[p][r] = s.neg_mul_add(y, c * x);
        a[q][r] = s.mul_add(x, c * y);
    }
}
