//! The sigma points of a batch.

use super::UnscentedFilter;
use crate::error::{Error, Result};
use crate::filter::{checks::shared, moments::tile, sigma_points::SigmaPoints};
use crate::math::dense::covariance_root;

impl UnscentedFilter {
    /// The points `(B, 2 n + 1, n)` of means and roots.
    pub(super) fn draw_from(&self, x: &[f64], roots: &[f64]) -> Vec<f64> {
        let n = self.dim_x;
        let rows = SigmaPoints::count(n);
        let mut out = vec![0.0; self.batch * rows * n];
        for ((x, root), out) in x.chunks_exact(n).zip(roots.chunks_exact(n * n)).zip(out.chunks_exact_mut(rows * n)) {
            self.points.draw(x, root, out);
        }
        out
    }

    /// The states and noises of the augmented points, `(B (4 n + 1), n)` each.
    pub(super) fn draw_augmented(&self, x: &[f64], roots: &[f64], Q: &[f64]) -> Result<(Vec<f64>, Vec<f64>)> {
        let (n, batch) = (self.dim_x, self.batch);
        let (rows, scale) = (SigmaPoints::count(2 * n), self.points.spread(2 * n).sqrt());
        let (mut states, mut noises) = (tile(x, n, rows), vec![0.0; batch * rows * n]);
        let mut noise_root = vec![0.0; n * n];
        for item in 0..batch {
            covariance_root(&mut shared(Q, item, n * n).to_vec(), n, &mut noise_root)
                .ok_or_else(|| Error::Numerical("Q has no positive semi-definite repair".into()))?;
            let states = &mut states[item * rows * n..(item + 1) * rows * n];
            let noises = &mut noises[item * rows * n..(item + 1) * rows * n];
            for k in 0..n {
                for i in 0..n {
                    let step = scale * roots[item * n * n + i * n + k];
                    states[(1 + k) * n + i] += step;
                    states[(1 + 2 * n + k) * n + i] -= step;
                    noises[(1 + n + k) * n + i] = scale * noise_root[i * n + k];
                    noises[(1 + 3 * n + k) * n + i] = -scale * noise_root[i * n + k];
                }
            }
        }
        Ok((states, noises))
    }
}
