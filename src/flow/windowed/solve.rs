//! The normal equations of a window from its moments, and their solution, one lane a pixel.

use super::rows::Plan;
use crate::math::Real;
use crate::simd::{Lanes, SimdReal};
use nalgebra::{Matrix6, SymmetricEigen, Vector6};

/// Index of entry (i, j), i <= j, in the list of the upper triangle, row by row.
#[inline(always)]
pub(crate) const fn upper(i: usize, j: usize) -> usize {
    i * (11 - i) / 2 + j
}

/// Entries of the upper triangle of a symmetric 6x6 matrix.
pub(crate) const ENTRIES: usize = 21;

/// Moments of one row of pixels: moment `k` of column `c` is `data[first + k * stride + c]`.
#[derive(Clone, Copy)]
pub(super) struct MomentRow<'a, T> {
    pub data: &'a [T],
    pub first: usize,
    pub stride: usize,
}

impl<T: SimdReal> MomentRow<'_, T> {
    #[inline(always)]
    pub fn load<V: Lanes<Scalar = T>>(&self, moment: usize, column: usize) -> V {
        V::load(&self.data[self.first + moment * self.stride + column..])
    }
}

/// Moment of the power x^a y^b that a product of columns of blocks `k` and `l` needs (0: flow, 1: d/dx, 2:
/// d/dy).
const POWER: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// The upper triangle of `sum w T^T A^T A T`: with `u = u0 + x u_x + y u_y` column `u_x` of `A T` is `x A_u +
/// A_{u_x}`, and so on.
#[inline(always)]
pub(super) fn normal_matrix<V: Lanes<Scalar = T>, T: SimdReal>(
    plan: Plan,
    row: &MomentRow<'_, T>,
    column: usize,
) -> [V; ENTRIES] {
    let mut n = [V::zero(); ENTRIES];
    for i in 0..6 {
        let (k, c) = (i / 2, i % 2);
        for j in i..6 {
            let (l, d) = (j / 2, j % 2);
            // Planes 0, 1, 2 hold u u, u v, v v.
            let mut sum = row.load::<V>(plan.base(c + d) + POWER[k][l], column);
            if l > 0
                && let Some(p) = plan.mixed(c, j)
            {
                sum = sum + row.load::<V>(plan.base(p) + k, column);
            }
            if k > 0 {
                if let Some(p) = plan.mixed(d, i) {
                    sum = sum + row.load::<V>(plan.base(p) + l, column);
                }
                if let Some(p) = plan.inner(i, j) {
                    sum = sum + row.load::<V>(plan.base(p), column);
                }
            }
            n[upper(i, j)] = sum;
        }
    }
    n
}

/// `sum w T^T A^T b`.
#[inline(always)]
pub(super) fn right_side<V: Lanes<Scalar = T>, T: SimdReal>(
    plan: Plan,
    row: &MomentRow<'_, T>,
    column: usize,
) -> [V; 6] {
    let first = plan.normal();
    std::array::from_fn(|i| {
        let (k, c) = (i / 2, i % 2);
        let mut sum = row.load::<V>(plan.base(first + c) + k, column);
        if k > 0 && plan.right() > 2 {
            sum = sum + row.load::<V>(plan.base(first + i), column);
        }
        sum
    })
}

/// `L L^T = D N D` with D such that the diagonal is 1.
pub(crate) struct Factor<V> {
    lower: [V; ENTRIES],
    inverse_pivot: [V; 6],
    scale: [V; 6],
    /// The smallest of: the pivots of the scaled matrix (what of a column, squared, is independent of those
    /// before it), and the columns' squares in relation to the largest.
    pub quality: V,
    /// The largest diagonal entry.
    pub largest: V,
}

/// Factors the normal matrix. Where it is singular the quality says so and the rest is meaningless (but
/// harmless).
#[inline(always)]
pub(crate) fn factor<V: Lanes>(n: &[V; ENTRIES]) -> Factor<V> {
    let one = V::constant(1.0);
    let mut largest = n[0];
    let mut least = n[0];
    for i in 1..6 {
        largest = largest.max(n[upper(i, i)]);
        least = least.min(n[upper(i, i)]);
    }
    let scale: [V; 6] = std::array::from_fn(|i| one / n[upper(i, i)].sqrt());
    let mut quality = least / largest;
    let mut lower = [V::zero(); ENTRIES];
    let mut inverse_pivot = [V::zero(); 6];
    // Column by column; entry (i, j) of L, i >= j, is kept at upper(j, i).
    for j in 0..6 {
        let mut pivot = one;
        for k in 0..j {
            let l = lower[upper(k, j)];
            pivot = l.neg_mul_add(l, pivot);
        }
        quality = quality.min(pivot);
        let inverse = one / pivot.sqrt();
        inverse_pivot[j] = inverse;
        for i in j + 1..6 {
            let mut sum = n[upper(j, i)] * scale[i] * scale[j];
            for k in 0..j {
                sum = lower[upper(k, i)].neg_mul_add(lower[upper(k, j)], sum);
            }
            lower[upper(j, i)] = sum * inverse;
        }
    }
    Factor { lower, inverse_pivot, scale, quality, largest }
}

impl<V: Lanes> Factor<V> {
    /// `N^-1 r`.
    #[inline(always)]
    pub fn solve(&self, right: &[V; 6]) -> [V; 6] {
        let mut x: [V; 6] = std::array::from_fn(|i| right[i] * self.scale[i]);
        for i in 0..6 {
            for k in 0..i {
                x[i] = self.lower[upper(k, i)].neg_mul_add(x[k], x[i]);
            }
            x[i] = x[i] * self.inverse_pivot[i];
        }
        for i in (0..6).rev() {
            for k in i + 1..6 {
                x[i] = self.lower[upper(i, k)].neg_mul_add(x[k], x[i]);
            }
            x[i] = x[i] * self.inverse_pivot[i];
        }
        std::array::from_fn(|i| x[i] * self.scale[i])
    }

    /// The upper triangle of `N^-1`.
    #[inline(always)]
    pub fn inverse(&self) -> [V; ENTRIES] {
        // The inverse of L, lower triangular, entry (i, j) at upper(j, i).
        let mut w = [V::zero(); ENTRIES];
        for j in 0..6 {
            w[upper(j, j)] = self.inverse_pivot[j];
            for i in j + 1..6 {
                let mut sum = V::zero();
                for k in j..i {
                    sum = self.lower[upper(k, i)].neg_mul_add(w[upper(j, k)], sum);
                }
                w[upper(j, i)] = sum * self.inverse_pivot[i];
            }
        }
        let mut out = [V::zero(); ENTRIES];
        for i in 0..6 {
            for j in i..6 {
                let mut sum = V::zero();
                for k in j..6 {
                    sum = w[upper(i, k)].mul_add(w[upper(j, k)], sum);
                }
                out[upper(i, j)] = sum * self.scale[i] * self.scale[j];
            }
        }
        out
    }
}

/// What a window whose equations leave something open still tells, in double precision.
pub(super) struct Deficient {
    /// Rank of the column-scaled equations.
    pub rank: u8,
    /// The solution of least norm in the scaled unknowns.
    pub solution: [f64; 6],
    /// Largest over smallest singular value of the column-scaled equations; infinite when singular.
    pub condition: f64,
}

/// Rank, least-norm solution and condition number of normal equations; `tolerance` is the least eigenvalue
/// ratio that counts.
pub(super) fn decompose<T: Real>(n: &[T; ENTRIES], right: &[T; 6], tolerance: f64, floor: f64) -> Deficient {
    let entry = |i: usize, j: usize| n[if i <= j { upper(i, j) } else { upper(j, i) }].to_f64();
    let matrix = Matrix6::from_fn(entry);
    let largest = matrix.diagonal().max();
    if !(largest.is_finite() && largest > floor) {
        return Deficient { rank: 0, solution: [0.0; 6], condition: f64::INFINITY };
    }
    let scaled = matrix / largest;
    let eigen = SymmetricEigen::new(scaled);
    let top = eigen.eigenvalues.max();
    let mut solution = Vector6::zeros();
    let mut rank = 0;
    let b = Vector6::from_fn(|i, _| right[i].to_f64() / largest);
    for k in 0..6 {
        let value = eigen.eigenvalues[k];
        if value > tolerance * top {
            let vector = eigen.eigenvectors.column(k);
            solution += vector * (vector.dot(&b) / value);
            rank += 1;
        }
    }
    let least = eigen.eigenvalues.min();
    let condition = if least > 0.0 { (top / least).sqrt() } else { f64::INFINITY };
    Deficient { rank, solution: solution.into(), condition }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::CounterRng;

    fn random_normal(seed: u64, columns: usize) -> ([f64; ENTRIES], Matrix6<f64>) {
        let rng = CounterRng::new(seed);
        let a = nalgebra::DMatrix::from_fn(12, columns, |i, j| {
            rng.normal((12 * j + i) as u64) * if j < 2 { 1.0 } else { 30.0 }
        });
        let wide = nalgebra::DMatrix::from_fn(12, 6, |i, j| a[(i, j % columns)]);
        let n = wide.transpose() * wide;
        let matrix = Matrix6::from_fn(|i, j| n[(i, j)]);
        let mut list = [0.0; ENTRIES];
        for i in 0..6 {
            for j in i..6 {
                list[upper(i, j)] = matrix[(i, j)];
            }
        }
        (list, matrix)
    }

    #[test]
    fn factor_solves_and_inverts() {
        for seed in 0..20 {
            let (list, matrix) = random_normal(seed, 6);
            let f = factor::<f64>(&list);
            assert!(f.quality > 1e-6);
            let want = Vector6::new(0.3, -0.2, 0.01, 0.02, -0.02, 0.01);
            let b = matrix * want;
            let got = f.solve(&b.into());
            let inverse = f.inverse();
            let check = matrix.try_inverse().unwrap();
            for i in 0..6 {
                assert!((got[i] - want[i]).abs() < 1e-9);
                for j in i..6 {
                    assert!((inverse[upper(i, j)] - check[(i, j)]).abs() < 1e-9 * check.norm());
                }
            }
            let d = decompose(&list, &b.into(), 1e-12, 0.0);
            assert_eq!(d.rank, 6);
            assert!((Vector6::from(d.solution) - want).norm() < 1e-8 && d.condition > 1.0);
        }
    }

    #[test]
    fn repeated_columns_are_seen_in_quality_and_rank() {
        let (list, _) = random_normal(5, 3);
        // A pivot that rounding made negative turns into NaN, which is not good enough either.
        let quality = factor::<f64>(&list).quality;
        assert!(quality.is_nan() || quality.abs() < 1e-12);
        assert_eq!(decompose(&list, &[1.0; 6], 1e-9, 0.0).rank, 3);
        assert_eq!(decompose(&[0.0; ENTRIES], &[0.0; 6], 1e-9, 0.0).rank, 0);
    }
}
