//! Symmetric 6x6 matrices as lists of their upper triangle, one a lane: Cholesky, solution, inverse, rank.

use crate::math::Real;
use crate::simd::Lanes;
use nalgebra::{Matrix6, SymmetricEigen, Vector6};

/// Index of entry (i, j), i <= j, in the list of the upper triangle, row by row.
#[inline(always)]
pub(crate) const fn upper(i: usize, j: usize) -> usize {
    i * (11 - i) / 2 + j
}

/// Entries of the upper triangle of a symmetric 6x6 matrix.
pub(crate) const ENTRIES: usize = 21;

/// Entry (i, j) of a matrix from its upper triangle.
#[inline(always)]
pub(crate) fn entry<V: Copy>(list: &[V; ENTRIES], i: usize, j: usize) -> V {
    list[upper(i.min(j), i.max(j))]
}

/// `L L^T = D N D` with D such that the diagonal is 1.
pub(crate) struct Factor<V> {
    lower: [V; ENTRIES],
    inverse_pivot: [V; 6],
    scale: [V; 6],
    /// The smallest of: the pivots of the scaled matrix (what of a column, squared, is independent of those
    /// before it), and the columns' squares in relation to the largest.
    pub quality: V,
    pub largest: V,
}

/// Factors the normal matrix. Where it is singular the quality says so; the rest is harmless.
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

/// Rank, least-norm solution and condition number (infinite when singular) of normal equations in double
/// precision; `tolerance` is the smallest eigenvalue ratio that counts.
pub(crate) fn decompose<T: Real>(n: &[T; ENTRIES], right: &[T; 6], tolerance: f64, floor: f64) -> (u8, [f64; 6], f64) {
    let matrix = Matrix6::from_fn(|i, j| entry(n, i, j).to_f64());
    let largest = matrix.diagonal().max();
    if !(largest.is_finite() && largest > floor) {
        return (0, [0.0; 6], f64::INFINITY);
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
    (rank, solution.into(), condition)
}

#[cfg(test)]
pub(in crate::flow) mod tests {
    use super::*;
    use crate::math::random::CounterRng;
    use nalgebra::DMatrix;

    /// The normal matrix of random equations with this many different columns, as a list and as a matrix.
    pub fn random_normal(seed: u64, columns: usize) -> ([f64; ENTRIES], Matrix6<f64>) {
        let rng = CounterRng::new(seed);
        let scale = |column: usize| if column < 2 { 1.0 } else { 30.0 };
        let a = DMatrix::from_fn(12, columns, |i, j| rng.normal((12 * j + i) as u64) * scale(j));
        let wide = DMatrix::from_fn(12, 6, |i, j| a[(i, j % columns)]);
        let n = wide.transpose() * wide;
        let mut list = [0.0; ENTRIES];
        for i in 0..6 {
            for j in i..6 {
                list[upper(i, j)] = n[(i, j)];
            }
        }
        (list, Matrix6::from_fn(|i, j| n[(i, j)]))
    }

    #[test]
    fn factor_solves_and_inverts() {
        for seed in 0..20 {
            let (list, matrix) = random_normal(seed, 6);
            let f = factor::<f64>(&list);
            assert!(f.quality > 1e-6);
            let want = Vector6::new(0.3, -0.2, 0.01, 0.02, -0.02, 0.01);
            let got = f.solve(&(matrix * want).into());
            let (inverse, check) = (f.inverse(), matrix.try_inverse().unwrap());
            for i in 0..6 {
                assert!((got[i] - want[i]).abs() < 1e-9);
                for j in i..6 {
                    assert!((inverse[upper(i, j)] - check[(i, j)]).abs() < 1e-9 * check.norm());
                }
            }
        }
    }

    #[test]
    fn full_rank_gives_the_solution_and_repeated_columns_are_counted() {
        let want = Vector6::new(0.3, -0.2, 0.01, 0.02, -0.02, 0.01);
        for seed in 0..20 {
            let (list, matrix) = random_normal(seed, 6);
            let (rank, solution, condition) = decompose(&list, &(matrix * want).into(), 1e-12, 0.0);
            assert_eq!(rank, 6);
            assert!((Vector6::from(solution) - want).norm() < 1e-8 && condition > 1.0);
        }
        let (list, _) = random_normal(5, 3);
        assert_eq!(decompose(&list, &[1.0; 6], 1e-9, 0.0).0, 3);
        assert_eq!(decompose(&[0.0; ENTRIES], &[0.0; 6], 1e-9, 0.0).0, 0);
    }
}
