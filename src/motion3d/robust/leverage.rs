//! Leverage check: of few points, outliers that fit by chance can decide the motion.

use super::INLIER;
use crate::ablation::keeps;
use crate::math::median;
use crate::motion3d::kernels::{depths, slopes};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::result::MotionEstimate;
use crate::motion3d::model::rows::{Matrix5, Vector5};
use crate::motion3d::solver::covariance::inverse;
use nalgebra::Matrix2x3;

/// From so many inliers on no few of them decide.
const MANY: usize = 300;

/// The share of cases in which no more outliers than assumed fit by chance.
const SURE: f64 = 0.95;

/// By how much the standard deviation may grow without the points that may be outliers.
const MAX_GROWTH: f64 = 2.0;

/// Whether the direction's standard deviation would more than double without the inliers of the highest
/// leverage, as many as outliers may fit by chance.
///
/// Outliers spread evenly have twice the median residual of the rejected as their range; `3 / (2 median)` of
/// them fall within three standard deviations.
pub(crate) fn has_high_leverage(observations: &Observations, found: &MotionEstimate) -> bool {
    let inliers: Vec<usize> = (0..observations.n).filter(|&k| found.inliers[observations.source[k] as usize]).collect();
    let rejected = observations.n - inliers.len();
    if !keeps("motion3d.leverage") || rejected == 0 || inliers.len() >= MANY {
        return false;
    }
    let chance = chance(observations, &found.motion, |k| found.inliers[observations.source[k] as usize]);
    let suspects = most_likely(chance * rejected as f64);
    let tangent = Matrix2x3::from_fn(|i, j| found.tangent[i][j]);
    let depth = |k: usize| found.inverse_depth_smooth[observations.source[k] as usize];
    let row = |&k: &usize| slopes(observations, &found.motion, &tangent, depth(k), k);
    let rows: Vec<Vector5> = inliers.iter().map(row).collect();
    grows(&rows, observations, suspects)
}

/// The share of outliers that are on their epipolar lines by chance, if they are spread evenly over twice
/// the median residual of the rejected.
fn chance(observations: &Observations, motion: &Motion, is_inlier: impl Fn(usize) -> bool) -> f64 {
    let seen = depths(observations, motion);
    let mut sizes: Vec<f64> =
        (0..observations.n).filter(|&k| !is_inlier(k)).map(|k| seen.e[k].abs() / observations.own()).collect();
    INLIER / (2.0 * median(&mut sizes).unwrap_or(0.0).max(INLIER))
}

/// The number that a Poisson variable of this mean exceeds in no more than 5 % of all cases.
fn most_likely(mean: f64) -> usize {
    let (mut term, mut count) = ((-mean).exp(), 0);
    let mut sum = term;
    while sum < SURE && count < MANY {
        count += 1;
        term *= mean / count as f64;
        sum += term;
    }
    count
}

/// Repeatedly removes the row without which the standard deviation grows most; whether it grows too much.
fn grows(rows: &[Vector5], observations: &Observations, suspects: usize) -> bool {
    let mut information: Matrix5 = rows.iter().map(|row| row * row.transpose()).sum();
    if let Some(known) = &observations.prior {
        let mut block = information.fixed_view_mut::<3, 3>(2, 2);
        block += known.information;
    }
    let Some(mut covariance) = inverse(&information) else { return true };
    let trace = |covariance: &Matrix5| covariance[(0, 0)] + covariance[(1, 1)];
    let limit = MAX_GROWTH * MAX_GROWTH * trace(&covariance);
    let mut left: Vec<&Vector5> = rows.iter().collect();
    for _ in 0..suspects.min(rows.len()) {
        // Without a row: `C + C d d^t C / (1 - d^t C d)`.
        let added = |row: &Vector5| {
            let moved = covariance * row;
            (moved[0] * moved[0] + moved[1] * moved[1]) / (1.0 - row.dot(&moved))
        };
        let costs: Vec<f64> = left.iter().map(|row| added(row)).collect();
        let worst = (0..left.len()).fold(0, |worst, k| if costs[k] > costs[worst] { k } else { worst });
        information -= left[worst] * left[worst].transpose();
        left.swap_remove(worst);
        let Some(next) = inverse(&information) else { return true };
        covariance = next;
        if trace(&covariance) > limit {
            return true;
        }
    }
    false
}
