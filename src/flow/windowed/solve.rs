//! The normal equations of a window from its moments, and their solution, one lane a pixel.

use super::rows::Plan;
use crate::flow::symmetric::{ENTRIES, upper};
use crate::math::Real;
use crate::simd::{Lanes, SimdReal};
use nalgebra::{Matrix6, SymmetricEigen, Vector6};

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

/// Solution of least norm of normal equations without full rank, in double precision.
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
    use crate::flow::symmetric::tests::random_normal;

    #[test]
    fn full_rank_gives_the_solution_and_repeated_columns_are_counted() {
        let want = Vector6::new(0.3, -0.2, 0.01, 0.02, -0.02, 0.01);
        for seed in 0..20 {
            let (list, matrix) = random_normal(seed, 6);
            let found = decompose(&list, &(matrix * want).into(), 1e-12, 0.0);
            assert_eq!(found.rank, 6);
            assert!((Vector6::from(found.solution) - want).norm() < 1e-8 && found.condition > 1.0);
        }
        let (list, _) = random_normal(5, 3);
        assert_eq!(decompose(&list, &[1.0; 6], 1e-9, 0.0).rank, 3);
        assert_eq!(decompose(&[0.0; ENTRIES], &[0.0; 6], 1e-9, 0.0).rank, 0);
    }
}
