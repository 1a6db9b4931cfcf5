//! The unscented transform with its covariance as a sum of squares.

use super::manifold::Manifold;
use super::sigma_points::SigmaPoints;
use crate::error::Result;
use crate::math::dense::add_gram;

/// Moments of propagated sigma points: `Cov = odd odd^T + even`.
///
/// The points `+k` and `-k` deviate from the mean by `a_k` and `b_k`, the centre by `e`. With `c = n +
/// lambda`, `odd_k = (a_k - b_k) / 2 sqrt(c)`, `s_k = a_k + b_k - 2 e`, `d = sum s_k / 2c`:
/// `even = sum s_k s_k^T / 4c + d e^T + e d^T + (2 - alpha^2 + beta) e e^T`. These are the usual weighted
/// moments. The difference of large terms, in which a small covariance would be lost, has cancelled
/// beforehand: of a linear function `even` is zero, and `odd = H L` where the points were `x +- sqrt(c) L_k`.
pub(super) struct Moments {
    /// Means `(B, w)`.
    pub mean: Vec<f64>,
    /// Deviations of all points from the mean, `(B, 2 d + 1, w)`.
    pub deviations: Vec<f64>,
    /// `(B, w, d)`.
    pub odd: Vec<f64>,
    /// `(B, w, w)`.
    pub even: Vec<f64>,
}

/// What sigma points have become.
#[derive(Debug, Clone, Copy)]
pub(super) enum Of {
    States,
    Measurements,
}

/// Moments of points `(B, 2 d + 1, w)` of `d` dimensions.
pub(super) fn moments(
    constants: &SigmaPoints,
    manifold: &mut impl Manifold,
    of: Of,
    points: &[f64],
    (d, w): (usize, usize),
) -> Result<Moments> {
    let rows = SigmaPoints::count(d);
    let batch = points.len() / (rows * w);
    let (weights, mut mean) = (constants.mean_weights(d), vec![0.0; batch * w]);
    match of {
        Of::States => manifold.x_mean(points, &weights, w, &mut mean)?,
        Of::Measurements => manifold.z_mean(points, &weights, w, &mut mean)?,
    }
    let (means, mut deviations) = (tile(&mean, w, rows), vec![0.0; points.len()]);
    match of {
        Of::States => manifold.residual_x(points, &means, &mut deviations)?,
        Of::Measurements => manifold.residual_z(points, &means, &mut deviations)?,
    }
    let (mut odd, mut even) = (vec![0.0; batch * w * d], vec![0.0; batch * w * w]);
    let c = constants.spread(d);
    let half = 0.5 / c.sqrt();
    let centre_weight = 2.0 - constants.alpha * constants.alpha + constants.beta;
    let (mut sums, mut shift) = (vec![0.0; w * d], vec![0.0; w]);
    for (item, all) in deviations.chunks_exact(rows * w).enumerate() {
        let (centre, pairs) = all.split_at(w);
        let (plus, minus) = pairs.split_at(d * w);
        let odd = &mut odd[item * w * d..(item + 1) * w * d];
        for (k, (a, b)) in plus.chunks_exact(w).zip(minus.chunks_exact(w)).enumerate() {
            for i in 0..w {
                odd[i * d + k] = half * (a[i] - b[i]);
                sums[i * d + k] = half * (a[i] + b[i] - 2.0 * centre[i]);
            }
        }
        for (shift, sums) in shift.iter_mut().zip(sums.chunks_exact(d)) {
            *shift = sums.iter().sum::<f64>() / c.sqrt();
        }
        let even = &mut even[item * w * w..(item + 1) * w * w];
        add_gram(&sums, d, even);
        for i in 0..w {
            for j in 0..w {
                even[i * w + j] += shift[i] * centre[j] + centre[i] * shift[j] + centre_weight * centre[i] * centre[j];
            }
        }
    }
    Ok(Moments { mean, deviations, odd, even })
}

/// `sum_k w_k a_k b_k^T` of deviations `(rows, wa)` and `(rows, wb)`.
pub(super) fn weighted_product(a: &[f64], b: &[f64], weights: &[f64]) -> Vec<f64> {
    let (wa, wb) = (a.len() / weights.len(), b.len() / weights.len());
    let mut out = vec![0.0; wa * wb];
    for ((a, b), &w) in a.chunks_exact(wa).zip(b.chunks_exact(wb)).zip(weights) {
        for (a, out) in a.iter().zip(out.chunks_exact_mut(wb)) {
            out.iter_mut().zip(b).for_each(|(out, b)| *out += w * a * b);
        }
    }
    out
}

/// Each row of `n` values, `rows` times.
pub(super) fn tile(x: &[f64], n: usize, rows: usize) -> Vec<f64> {
    x.chunks_exact(n).flat_map(|x| std::iter::repeat_n(x, rows)).flatten().copied().collect()
}
