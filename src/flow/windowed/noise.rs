//! How white pixel noise enters the equations: through the right-hand side `-i'`, `-i''` and, times m,
//! through the coefficients `P(i)`, `P(i')`.

use super::{combine::Combination, equations::columns, options::WindowedOptions};
use crate::flow::moment_filter::weights;
use crate::jet::JetStencil;
use nalgebra::{Matrix6, SymmetricEigen, Vector6};

/// Second moments of the noise, per unit variance of the pixels, in the scaled unknowns.
pub(super) struct PixelNoise {
    /// Expected sum of squares in rows 1-6 of one pixel whose motion is taken out.
    pub residual: f64,
    /// `E[sum w T^T dP^T dP T]`: what noise adds to the normal matrix of a whole window.
    pub normal: Matrix6<f64>,
    /// How much of i, i' and i'' the noise of each frame makes.
    pub ways: Vec<[f64; 3]>,
    /// Expected `k^T V^-1 k` of the difference k of the third estimate to the first, without curvature.
    pub curvature: f64,
    /// 1 / sigma of the window.
    pub scale: f64,
    /// Variance of the pixels; `None`: from the frames.
    pub variance: Option<f64>,
    /// Smallest variance: that of rounding, for frames of whole grey levels.
    pub min_variance: f64,
}

impl PixelNoise {
    /// For the options, their stencil and combination of frames, and these variances.
    pub fn new(
        (options, stencil, combination): (&WindowedOptions, &JetStencil, Combination),
        (variance, min_variance): (Option<f64>, f64),
    ) -> Self {
        let (rows, scale) = (options.rows.count(), 1.0 / options.sigma);
        let jet = jet_covariance(stencil, options.presmooth);
        let w = combination.weights();
        let power = |way: usize| w[way].iter().map(|w| w * w).sum::<f64>();
        let coefficients = power(0) + if rows == 12 { power(1) } else { 0.0 };
        let block = rows.min(6);
        let jets = SymmetricEigen::new(jet);
        // P is linear in the jet, whose noise is a sum of independent ones along its principal axes.
        let along = |k: usize| {
            let columns = columns::<f64, 6>(&jets.eigenvectors.column(k).into_owned().into()).map(Vector6::from);
            let rows = Matrix6::from_columns(&columns).rows(0, block).into_owned();
            rows.tr_mul(&rows) * (jets.eigenvalues[k] * coefficients)
        };
        let unit = Matrix6::from_diagonal(&[1.0, 1.0, scale, scale, scale, scale].into());
        let own = unit * (0..6).map(along).sum::<Matrix6<f64>>() * unit;
        // Transport adds the flow's columns times x or y, whose moments over the window are 0, 0, 1, 0, 1.
        let normal =
            Matrix6::from_fn(|a, b| own[(a, b)] + if a > 1 && a / 2 == b / 2 { own[(a % 2, b % 2)] } else { 0.0 });
        Self {
            residual: jet.diagonal().rows(0, block).sum() * power(1),
            normal,
            curvature: unsmooth_share(options.presmooth.unwrap_or(0.0) * scale),
            scale,
            variance,
            min_variance,
            ways: (0..combination.times().len()).map(|f| [w[0][f], w[1][f], w[2][f]]).collect(),
        }
    }
}

/// Sum over the six unknowns of the share of noise that a second pass of the window removes.
///
/// The noise of the flow has the spectrum `G^a`, `a = 2 (1 + (smooth / sigma)^2)`, G the window's transfer
/// function and `smooth` in units of its sigma; that of the derivatives is times the squared frequency. The
/// share is the integral of `(1 - G)^2 G^a` over that of `G^a`.
fn unsmooth_share(smooth: f64) -> f64 {
    let a = 2.0 * (1.0 + smooth * smooth);
    let share = |power: i32| 1.0 - 2.0 * (a / (a + 1.0)).powi(power) + (a / (a + 2.0)).powi(power);
    2.0 * share(1) + 4.0 * share(2)
}

/// Weights at distance 0, 1, ... of the Gaussian that smooths frames, cut like
/// [`crate::image::GaussianSmoother`]; 1 without smoothing.
pub(super) fn smoothing_weights(sigma: Option<f64>) -> Vec<f64> {
    sigma.map_or_else(|| vec![1.0], |sigma| weights(sigma, (4.0 * sigma + 0.5) as usize))
}

/// Covariance of the jet for white pixel noise of variance 1 that was smoothed before.
fn jet_covariance(stencil: &JetStencil, smooth: Option<f64>) -> Matrix6<f64> {
    let half = smoothing_weights(smooth);
    let r = half.len() as i32 - 1;
    let weight = |k: i32| half.get(k.unsigned_abs() as usize).copied().unwrap_or(0.0);
    let correlation = |d: i32| (-r..=r).map(|k| weight(k) * weight(k + d)).sum::<f64>();
    let mut covariance = Matrix6::zeros();
    for (o, w) in stencil.offsets().iter().zip(stencil.weights()) {
        for (p, z) in stencil.offsets().iter().zip(stencil.weights()) {
            let together = correlation(o.0 - p.0) * correlation(o.1 - p.1);
            covariance += together * Vector6::from(*w) * Vector6::from(*z).transpose();
        }
    }
    covariance
}
