//! Unknown noise from the residuals of the inliers; and of few points, whether they have outliers at all, and
//! whether a few that fit by chance decide.
//!
//! One motion of all points in larger noise may be as good an explanation as one of the points that happen to
//! agree.

use super::{Consensus, INLIER};
use crate::ablation::keeps;
use crate::math::{TRUNCATED_INFORMATION, binomial_tail, median, random::CounterRng, truncated_std};
use crate::motion3d::kernels::{add_to_rotation, depths, slopes};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::{Observations, UNKNOWNS};
use crate::motion3d::model::result::MotionEstimate;
use crate::motion3d::model::rows::{Matrix5, Vector5};
use crate::motion3d::model::whitening::Whitening;
use crate::motion3d::solver::covariance::{direction_deviation, inverse};
use crate::motion3d::solver::finite_rotation::settle;
use crate::motion3d::solver::likelihood::minima;
use nalgebra::Matrix2x3;

/// First guess of unknown noise, as a share of the median flow.
pub(crate) const FIRST_SHARE: f64 = 0.05;

/// Standard deviations by which the noise of the inliers must exceed the given one.
const LARGER: f64 = 4.0;

/// Variance of the noise of the inliers relative to the given one, if chance does not explain the
/// difference; 1 if errors are not independent.
pub(crate) fn larger(observations: &Observations, motion: &Motion) -> f64 {
    if !observations.independent || !keeps("motion3d.larger_noise") {
        return 1.0;
    }
    let variance = truncated_std(&depths(observations, motion).e[..observations.n], UNKNOWNS).powi(2);
    let chance = LARGER * (2.0 / (TRUNCATED_INFORMATION * observations.n as f64)).sqrt();
    if variance > 1.0 + chance { variance } else { 1.0 }
}

/// Estimates the noise of all points if all are inliers of one motion.
pub(crate) fn noise_std(whitening: &Whitening<'_>, observations: &Observations, rng: CounterRng) -> Option<f64> {
    let mut found = minima(observations, rng.stream(20));
    settle(whitening, &mut observations.clone(), &mut found);
    let degrees = observations.n.saturating_sub(UNKNOWNS).max(1) as f64;
    let noise_std = (found.first()?.equations.cost / degrees).sqrt();
    (noise_std.is_finite() && noise_std > 0.0).then_some(noise_std)
}

/// By how much the mean square may exceed what the median says of it.
const TAILS: f64 = 1.5;

/// Whether the lengths of two-dimensional residuals are those of one normal distribution, whose squares have
/// the mean 2 and the median `2 ln 2` variances: a few large ones raise the mean.
pub(crate) fn one_noise(residuals: impl Iterator<Item = f64>) -> bool {
    let mut squares: Vec<f64> = residuals.map(|rest| rest * rest).collect();
    let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
    mean <= TAILS * median(&mut squares).unwrap_or(0.0) / std::f64::consts::LN_2
}

/// By how much, in nats, outliers shorten the description of the residuals (J. Rissanen 1978): from that with
/// `noise_std`, in present units of noise, for all points to that with the noise of the inliers, outliers
/// uniform over the residuals' range, and `ln C(n, k)` for which points these are.
pub(crate) fn shortening(observations: &Observations, found: &Consensus, noise_std: f64) -> f64 {
    let (n, k) = (observations.n, found.inliers.len());
    if k >= n {
        return 0.0;
    }
    let seen = depths(observations, &found.motion);
    let sum = |k: &u32| seen.e[*k as usize].powi(2);
    let own = (found.inliers.iter().map(sum).sum::<f64>() / k.saturating_sub(UNKNOWNS).max(1) as f64).sqrt();
    let range = 2.0 * seen.e[..n].iter().fold(0.0f64, |most, e| most.max(e.abs()));
    let normal = |count: usize, noise_std: f64| {
        let free = count.saturating_sub(UNKNOWNS) as f64;
        free * (noise_std.ln() + 0.5) + 0.5 * count as f64 * (2.0 * std::f64::consts::PI).ln()
    };
    let chosen: f64 = (0..n - k).map(|i| ((n - i) as f64 / (i + 1) as f64).ln()).sum();
    let apart = normal(k, own) + (n - k) as f64 * range.ln() + chosen;
    normal(n, noise_std) - apart
}

/// From so many inliers on no few of them decide.
const MANY: usize = 300;

/// The chance that more outliers than assumed fit.
const MORE: f64 = 0.05;

/// By how much the standard deviation may grow without the points that may be outliers.
const MAX_GROWTH: f64 = 2.0;

/// Whether the direction's standard deviation would more than double without the inliers of the highest
/// leverage, as many as outliers may fit by chance.
///
/// Outliers spread evenly have twice the median residual of the rejected as their range; `3 / (2 median)` of
/// them fall within three standard deviations.
pub(crate) fn has_high_leverage(observations: &Observations, found: &MotionEstimate) -> bool {
    let is_inlier = |k: &usize| found.inliers[observations.source[*k] as usize];
    let (inliers, rejected): (Vec<usize>, Vec<usize>) = (0..observations.n).partition(is_inlier);
    if !keeps("motion3d.leverage") || rejected.is_empty() || inliers.len() >= MANY {
        return false;
    }
    let seen = depths(observations, &found.motion);
    let mut sizes: Vec<f64> = rejected.iter().map(|&k| seen.e[k].abs() / observations.own()).collect();
    let chance = INLIER / (2.0 * median(&mut sizes).unwrap_or(0.0).max(INLIER));
    let all = rejected.len();
    let suspects = (0..all.min(MANY)).find(|count| binomial_tail(count + 1, all, chance) < MORE);
    let tangent = Matrix2x3::from_fn(|i, j| found.tangent[i][j]);
    let depth = |k: usize| found.inverse_depth_smooth[observations.source[k] as usize];
    let row = |&k: &usize| slopes(observations, &found.motion, &tangent, depth(k), k);
    let rows: Vec<Vector5> = inliers.iter().map(row).collect();
    grows(&rows, observations, suspects.unwrap_or(all))
}

/// Repeatedly removes the row without which the standard deviation grows most; whether it grows too much.
fn grows(rows: &[Vector5], observations: &Observations, suspects: usize) -> bool {
    let mut information: Matrix5 = rows.iter().map(|row| row * row.transpose()).sum();
    if let Some(known) = &observations.prior {
        add_to_rotation(&mut information, &known.information, 1.0);
    }
    let Some(mut covariance) = inverse(&information) else { return true };
    let limit = MAX_GROWTH * direction_deviation(&covariance);
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
        if direction_deviation(&covariance) > limit {
            return true;
        }
    }
    false
}
