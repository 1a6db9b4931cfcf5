//! Square roots of covariances, which turn standard normals into noise.

use crate::math::dense::cholesky;
use nalgebra::{DMatrix, SymmetricEigen};

/// A root `L` with `L L^T = C` of each covariance `(n, n)`, one after another: the Cholesky factor or, where
/// there is none, `V sqrt(D)` of the eigenvalues D and vectors V. So a direction without noise gets none.
pub(super) fn roots(covariances: &[f64], n: usize) -> Vec<f64> {
    let mut all = vec![0.0; covariances.len()];
    for (covariance, root) in covariances.chunks_exact(n * n).zip(all.chunks_exact_mut(n * n)) {
        if cholesky(covariance, n, root) {
            continue;
        }
        let eigen = SymmetricEigen::new(DMatrix::from_row_slice(n, n, covariance));
        for (k, value) in root.iter_mut().enumerate() {
            let (row, column) = (k / n, k % n);
            *value = eigen.eigenvectors[(row, column)] * eigen.eigenvalues[column].max(0.0).sqrt();
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::dense::multiply_transposed;

    #[test]
    fn roots_give_their_covariances_back() {
        let matrices = [
            [4.0, 2.0, 0.0, 2.0, 3.0, 1.0, 0.0, 1.0, 2.0],
            [1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 5.0],
            [0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.02],
            [0.0; 9],
        ];
        let roots = roots(&matrices.concat(), 3);
        for (root, covariance) in roots.chunks_exact(9).zip(&matrices) {
            let mut product = [0.0; 9];
            multiply_transposed(root, root, 3, &mut product);
            for (got, want) in product.iter().zip(covariance) {
                assert!((got - want).abs() < 1e-14, "{product:?}");
            }
        }
        assert_eq!(roots[18 + 3..18 + 6], [0.0; 3], "no noise where the variance is zero");
        assert_eq!(roots[27..], [0.0; 9]);
    }
}
