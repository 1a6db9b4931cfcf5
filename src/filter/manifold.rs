//! Differences, means and sums of states and measurements that are not vectors, such as angles.

use crate::error::Result;

/// How a filter subtracts, averages and adds; by default as vectors are (C. Hertzberg et al., "Integrating
/// generic sensor fusion algorithms with sound state representations through encapsulation of manifolds",
/// 2013).
///
/// Each function serves the whole batch at once: arrays are rows of `n` (states) or `m` numbers
/// (measurements), one after the other.
pub trait Manifold {
    /// `a - b` of states.
    ///
    /// # Errors
    /// What an implementation reports; so for the others.
    fn residual_x(&mut self, a: &[f64], b: &[f64], out: &mut [f64]) -> Result<()> {
        subtract(a, b, out);
        Ok(())
    }

    /// `a - b` of measurements.
    fn residual_z(&mut self, a: &[f64], b: &[f64], out: &mut [f64]) -> Result<()> {
        subtract(a, b, out);
        Ok(())
    }

    /// The state `x` moved by the difference `dx`.
    fn state_add(&mut self, x: &[f64], dx: &[f64], out: &mut [f64]) -> Result<()> {
        out.iter_mut().zip(x).zip(dx).for_each(|((out, x), dx)| *out = x + dx);
        Ok(())
    }

    /// The weighted mean of each `weights.len()` rows of `n` numbers; weights sum to one and may be negative.
    fn x_mean(&mut self, points: &[f64], weights: &[f64], n: usize, out: &mut [f64]) -> Result<()> {
        weighted_means(points, weights, n, out);
        Ok(())
    }

    /// As [`x_mean`](Self::x_mean), of measurements.
    fn z_mean(&mut self, points: &[f64], weights: &[f64], m: usize, out: &mut [f64]) -> Result<()> {
        weighted_means(points, weights, m, out);
        Ok(())
    }
}

/// States and measurements are vectors.
#[derive(Debug, Clone, Copy, Default)]
pub struct Vectors;

impl Manifold for Vectors {}

fn subtract(a: &[f64], b: &[f64], out: &mut [f64]) {
    out.iter_mut().zip(a).zip(b).for_each(|((out, a), b)| *out = a - b);
}

/// `sum_k w_k rows_k`, relative to the first row so that large common offsets do not cost digits.
fn weighted_means(points: &[f64], weights: &[f64], width: usize, out: &mut [f64]) {
    for (rows, mean) in points.chunks_exact(weights.len() * width).zip(out.chunks_exact_mut(width)) {
        let centre = &rows[..width];
        mean.copy_from_slice(centre);
        for (row, &w) in rows.chunks_exact(width).zip(weights).skip(1) {
            mean.iter_mut().zip(row).zip(centre).for_each(|((m, &r), &c)| *m += w * (r - c));
        }
    }
}
