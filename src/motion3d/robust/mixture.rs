//! The last steps towards the motion among points of which some are outliers.
//!
//! With the probability `g(e)` of each point that it is an inlier
//! ([`outlier_posterior`](crate::motion3d::robust::outlier_posterior)), the estimating equation is
//! `sum g(e) e D(nu~)^t = 0`, solved by repeated weighting. Outliers spread evenly add nothing to its mean, and
//! nothing to its slope: when the motion changes, so do those that fit it. So the slope is that of the inliers
//! alone, the mean of `g e^2 D^t D` by parts. Least squares on a fixed set of points treat outliers as inliers.

use super::depth_consistency::{DepthConsistency, Judged};
use super::outlier_posterior::{Odds, OutlierPosterior, normal};
use super::{Consensus, INLIER, MIN_POINTS, inliers_of};
use crate::motion3d::kernels::{depths, information};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::rows::{Matrix5, carried};
use crate::motion3d::solver::efficient::solve;
use nalgebra::Matrix2x3;
use std::borrow::Cow;

/// The square of all steps, in standard deviations, from which on they lead to another motion.
const FARTHEST: f64 = 11.0;

/// Times that the probabilities are updated on the way to a root, and a change of the direction, rad, that
/// is not worth another.
const ROUNDS: usize = 8;
const SETTLED: f64 = 1e-3;

/// The points times the roots of weights: at a motion, those of inliers by their odds.
fn weighted(all: &Observations, motion: &Motion, weight: impl Fn(usize, f64) -> Option<f64>) -> Observations {
    let (seen, own) = (depths(all, motion), all.own());
    all.weighted(|k| {
        let fits = seen.e[k].abs() < INLIER * own && seen.nu[k] * seen.s2[k].sqrt() > -INLIER * own;
        if fits { weight(k, normal(seen.e[k] / own)).unwrap_or(0.0) } else { 0.0 }
    })
}

/// The probability of an inlier where its residual has this density.
fn posterior(odds: &Odds, density: f64) -> f64 {
    density / (density + odds.outliers)
}

/// From the motion of the inliers, with the depths `smooth` of these in its weights (`None`: their
/// own), to the root of the equation with probabilities, if it `moves`; the covariance, in the axes `tangent`,
/// grows as the information shrinks. `None` where nothing is known of outliers.
pub(crate) fn weighted_by_posterior(
    all: &Observations,
    known: &Consensus,
    (from, tangent, covariance): (&Motion, &Matrix2x3<f64>, &Matrix5),
    smooth: Option<&[f64]>,
    moves: bool,
) -> Option<(Motion, Matrix2x3<f64>, Matrix5)> {
    let outliers = known.outliers.as_ref()?;
    let odds = |k: usize| outliers.of(k);
    let by_point = smooth.map(|smooth| of_all(all, &known.inliers, smooth));
    let nu = |motion: &Motion| by_point.as_deref().map_or_else(|| Cow::Owned(depths(all, motion).nu), Cow::Borrowed);
    let root = || -> Option<Motion> {
        let mut motion = *from;
        for _ in 0..ROUNDS {
            let points = weighted(all, &motion, |k, density| Some(posterior(&odds(k)?, density)));
            let next = solve(&points, &motion, &nu(&motion))?;
            let change = next.angle_to(&motion);
            motion = next;
            if change < SETTLED {
                break;
            }
        }
        Some(motion)
    };
    let informed = |motion: &Motion, tangent: &Matrix2x3<f64>| {
        let share = |k: usize, density: f64| odds(k).map(|odds| posterior(&odds, density) * odds.information);
        information(&weighted(all, motion, share), motion, tangent, &nu(motion), 0.0)
    };
    let inner = all.subset(&known.inliers);
    let own = smooth.map_or_else(|| Cow::Owned(depths(&inner, from).nu), Cow::Borrowed);
    let before = information(&inner, from, tangent, &own, 0.0).cholesky()?.l().transpose();
    let near = |motion: &Motion| {
        let off = motion.offset(from, tangent);
        off.dot(&(informed(from, tangent) * off)) < FARTHEST
    };
    let motion = if moves { root().filter(near).unwrap_or(*from) } else { *from };
    let axes = carried(tangent, &motion.u());
    let grown = informed(&motion, &axes).cholesky()?.l().transpose().try_inverse()? * before;
    let covariance = grown * covariance * grown.transpose();
    Some((motion, axes, 0.5 * (covariance + covariance.transpose())))
}

/// The values of some of the points by point, for all others their mean.
fn of_all(all: &Observations, inner: &[u32], values: &[f64]) -> Vec<f64> {
    let mean = inner.iter().zip(values).map(|(_, value)| value).sum::<f64>() / inner.len().max(1) as f64;
    let mut out = vec![mean; all.n];
    for (&k, &value) in inner.iter().zip(values) {
        out[k as usize] = value;
    }
    out
}

/// From a motion that was found by least squares to the root of the equation with probabilities, with
/// updated probabilities on the way; with its cost. `None` if too few are inliers.
///
/// Outliers with depths of their own, which are large, weigh most in least squares; drawn to their
/// neighbours' they weigh as inliers do.
pub(crate) fn refined_by_posterior(
    all: &Observations,
    gate: &DepthConsistency<'_>,
    start: Motion,
) -> Option<(Motion, f64)> {
    let (mut motion, mut rounds) = (start, 0..ROUNDS);
    loop {
        let inliers = inliers_of(all, &motion);
        let Judged { outliers, smooth, cost } =
            gate.judged(&motion, &inliers).filter(|_| inliers.len() >= MIN_POINTS)?;
        if rounds.next().is_none() {
            return Some((motion, cost));
        }
        let points = weighted(all, &motion, |k, density| Some(posterior(&outliers.of(k)?, density)));
        let Some(next) = solve(&points, &motion, &smooth) else { return Some((motion, cost)) };
        if next.angle_to(&motion) < SETTLED {
            rounds = 0..0;
        }
        motion = next;
    }
}
