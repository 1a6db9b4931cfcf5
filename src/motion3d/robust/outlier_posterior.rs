//! Probability that an inlier is an outlier that fits by chance, by how far its depth is from its
//! neighbours'.
//!
//! Of points whose depths deviate alike, `h` inliers have residuals with the density `h phi(e)`, and
//! outliers, which do not depend on the motion, `b` in every unit of residual. Points a little farther from
//! their epipolar lines than inliers determine `b`; the remaining inliers determine `h`. A point is an inlier
//! with the probability `h phi(e) / (h phi(e) + b)`.
//!
//! With this probability `g(e)` the estimating equation is `sum g(e) e D(nu~)^t = 0`, solved by repeated
//! weighting. Outliers spread evenly add nothing to its mean or its slope, which is that of the inliers: the
//! mean of `g e^2 D^t D` by parts. Least squares on a fixed set of points treat outliers as inliers.

use super::{Consensus, INLIER};
use crate::math::{binomial_tail, carried};
use crate::motion3d::kernels::{Weighted, depths, information};
use crate::motion3d::model::{motion::Motion, observations::Observations, rows::Matrix5};
use crate::motion3d::solver::{covariance::PLAUSIBLE, efficient::solve};
use nalgebra::Matrix2x3;
use std::borrow::Cow;
use std::ops::Range;

/// Residuals, in units of noise, from which outliers are counted: almost no inlier has so large a residual.
pub(crate) const BAND: Range<f64> = 4.0..10.0;

/// The share of inliers that have residuals beyond that, and a margin.
const BEYOND: f64 = 1e-4;

/// Sizes of deviations at which bins begin; from the last one on they double.
const FIRST: [f64; 6] = [0.0, 0.5, 1.0, 1.5, 2.0, 3.0];
pub(crate) const DOUBLING: f64 = 4.0;
const SIZES: usize = 16;

/// Bins of both signs.
const BINS: usize = 2 * SIZES;

/// The least odds of outliers: one for a million of inliers.
const MIN_ODDS: f64 = 1e-6;

/// Bins from here on are odd enough to be left out where outliers are the most of them.
const TAIL: usize = 4;

/// Probability, over all bins, that outliers alone make odd depths so many.
const RARE: f64 = 1e-3;

/// What points of one bin are.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Odds {
    /// `b / h`: outliers in a unit of residual for every inlier; infinite where outliers explain all of the
    /// points.
    pub outliers: f64,
    /// The information of an inlier's residual relative to that without outliers.
    pub information: f64,
}

/// The odds of all points.
#[derive(Debug, Clone)]
pub(crate) struct OutlierPosterior {
    /// Of each point that was counted.
    bins: Vec<Option<u8>>,
    odds: [Odds; BINS],
    dropped: [bool; BINS],
    /// The share of outliers among all inliers that are kept.
    pub share: f64,
}

/// The density of a standard normal distribution.
pub(crate) fn normal(e: f64) -> f64 {
    (-0.5 * e * e).exp() / (2.0 * std::f64::consts::PI).sqrt()
}

/// The share of a normal distribution within the limit of inliers.
const WITHIN: f64 = 0.997_300_2;

/// `int phi^2 e^2 / (phi + outliers) de` over the inliers: the mean of `g e^2` of inliers, which by parts
/// is the mean slope of `g e`, jumps at the limit included, too.
fn relative_information(outliers: f64) -> f64 {
    const STEPS: i32 = 60;
    let step = 2.0 * INLIER / f64::from(STEPS);
    let value = |i: i32| {
        let e = step * f64::from(i) - INLIER;
        let density = normal(e);
        let end = if i == 0 || i == STEPS { 0.5 } else { 1.0 };
        end * density * density * e * e / (density + outliers)
    };
    (0..=STEPS).map(value).sum::<f64>() * step / WITHIN
}

fn bin(deviation: f64) -> usize {
    let size = deviation.abs();
    let place = if size < DOUBLING {
        FIRST.iter().rposition(|&from| from <= size).unwrap_or(0)
    } else {
        // An infinite deviation is in the last bin.
        FIRST.len() + ((size / DOUBLING).log2() as usize).min(SIZES - 1 - FIRST.len())
    };
    if deviation < 0.0 { SIZES + place } else { place }
}

impl OutlierPosterior {
    /// Counts the `near` points, whose residuals `e` are at most the band's end, by the `deviations` of their
    /// depths.
    pub fn new(e: &[f64], near: &[u32], deviations: &[f64], is_inlier: &[bool]) -> Self {
        let mut bins = vec![None; e.len()];
        let (mut fitted, mut beside) = ([0usize; BINS], [0usize; BINS]);
        for (&k, &deviation) in near.iter().zip(deviations) {
            let (k, place) = (k as usize, bin(deviation));
            bins[k] = Some(place as u8);
            fitted[place] += usize::from(is_inlier[k]);
            beside[place] += usize::from(BAND.contains(&e[k].abs()));
        }
        let far = e.iter().filter(|e| e.abs() >= BAND.start).count();
        let any = far as f64 > BEYOND * e.len() as f64;
        let wider = INLIER / (BAND.end - BAND.start);
        // Each outlier fits with the share of the strip of inliers; one more may be unseen.
        let share = wider / (1.0 + wider);
        let (mut odds, mut dropped) = ([Odds { outliers: f64::INFINITY, information: 0.0 }; BINS], [false; BINS]);
        let (mut left, mut left_outliers) = (0.0, 0.0);
        for place in 0..BINS {
            let odd = place % SIZES >= FIRST.len();
            let (expected, count) = (beside[place] as f64 * wider, fitted[place] as f64);
            let explained =
                any && binomial_tail(fitted[place], fitted[place] + beside[place] + 1, share) > RARE / BINS as f64;
            let tail = place % SIZES >= TAIL;
            dropped[place] = odd && explained || tail && count < 2.0 * expected;
            let inliers = (count - expected) / WITHIN;
            if !dropped[place] && inliers > 0.0 {
                // Where none was seen there may be one.
                let unseen = if any { wider } else { 0.0 };
                let outliers = (expected + unseen) / (2.0 * INLIER) / inliers;
                odds[place] = Odds { outliers, information: relative_information(outliers) };
            }
            if !dropped[place] {
                (left, left_outliers) = (left + count, left_outliers + expected.min(count));
            }
        }
        let kept = if left > 0.0 { left_outliers / left } else { 0.0 };
        Self { bins, odds, dropped, share: kept }
    }

    /// Twice by how much, in nats, a point with the residual `e` is likelier among inliers and outliers than
    /// among outliers alone.
    pub fn gain(&self, k: usize, e: f64) -> f64 {
        self.of(k).map_or(0.0, |odds| 2.0 * (normal(e) / odds.outliers.max(MIN_ODDS)).ln_1p())
    }

    /// Whether outliers do not explain points like this one.
    pub fn keeps(&self, k: u32) -> bool {
        self.bins[k as usize].is_some_and(|bin| !self.dropped[bin as usize])
    }

    /// The odds of a point; `None` where it is farther from its line than any that was counted, or outliers
    /// explain it.
    pub fn of(&self, k: usize) -> Option<Odds> {
        self.bins[k].map(|bin| self.odds[bin as usize]).filter(|odds| odds.outliers.is_finite())
    }
}

/// Times that the probabilities are updated on the way to a root, and a change of the direction, rad, that
/// is not worth another.
pub(crate) const ROUNDS: usize = 8;
pub(crate) const SETTLED: f64 = 1e-3;

/// The points times the roots of weights: at a motion, those of inliers by their odds.
pub(crate) fn weighted(
    all: &Observations,
    motion: &Motion,
    weight: impl Fn(usize, f64) -> Option<f64>,
) -> Observations {
    let (seen, own) = (depths(all, motion), all.own());
    all.weighted(|k| {
        let fits = seen.e[k].abs() < INLIER * own && seen.nu[k] * seen.s2[k].sqrt() > -INLIER * own;
        if fits { weight(k, normal(seen.e[k] / own)).unwrap_or(0.0) } else { 0.0 }
    })
}

/// The probability of an inlier where its residual has this density.
pub(crate) fn posterior(odds: &Odds, density: f64) -> f64 {
    density / (density + odds.outliers)
}

/// The root of the equation with probabilities, if it `moves` from the motion of the inliers, whose weights
/// have the depths `smooth` (`None`: their own); its axes, and the covariance, which grows as the information
/// shrinks. `None` where nothing is known of outliers.
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
        information(&weighted(all, motion, share), &Weighted { motion, tangent, nu: &nu(motion) }, 0.0)
    };
    let inner = all.subset(&known.inliers);
    let own = smooth.map_or_else(|| Cow::Owned(depths(&inner, from).nu), Cow::Borrowed);
    let before = information(&inner, &Weighted { motion: from, tangent, nu: &own }, 0.0).cholesky()?.l().transpose();
    let near = |motion: &Motion| {
        let off = motion.offset(from, tangent);
        off.dot(&(informed(from, tangent) * off)) < PLAUSIBLE
    };
    let motion = if moves { root().filter(near).unwrap_or(*from) } else { *from };
    let axes = carried(tangent, &motion.u());
    let grown = informed(&motion, &axes).cholesky()?.l().transpose().try_inverse()? * before;
    let covariance = grown * covariance * grown.transpose();
    Some((motion, axes, covariance.symmetric_part()))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::CounterRng;

    #[test]
    fn bins_follow_each_other() {
        let sizes = [0.0, 0.6, 1.2, 1.7, 2.5, 3.9, 4.0, 8.0, 17.0, f64::INFINITY];
        let bins: Vec<usize> = sizes.iter().map(|&size| bin(size)).collect();
        assert_eq!(bins, [0, 1, 2, 3, 4, 5, 6, 7, 8, SIZES - 1]);
        assert_eq!(bin(-2.5), SIZES + 4);
    }

    /// A quarter of the information is lost where outliers are a third of the inliers; without outliers
    /// only what lies beyond the limit is missing.
    #[test]
    fn outliers_take_information_away() {
        assert!((relative_information(0.0) - 0.9733).abs() < 1e-3, "{}", relative_information(0.0));
        let mean = |outliers: f64| {
            let rng = CounterRng::new(3);
            let (mut sum, mut count) = (0.0, 0.0f64);
            for k in 0..200_000 {
                let e = rng.normal(k);
                if e.abs() < INLIER {
                    sum += e * e * normal(e) / (normal(e) + outliers);
                    count += 1.0;
                }
            }
            sum / count
        };
        for outliers in [0.01, 0.1] {
            assert!(
                (relative_information(outliers) - mean(outliers)).abs() < 0.01,
                "{outliers}: {} {}",
                relative_information(outliers),
                mean(outliers)
            );
        }
    }

    /// A hundred points with an odd depth stay without outliers, and among as many others; ten among outliers
    /// that explain them do not.
    #[test]
    fn odd_depths_are_outliers_where_these_are_as_many() {
        let run = |odd: u32, beside: u32| {
            let (mut e, mut deviations) = (vec![0.5; 1000], vec![0.1; 500]);
            deviations.resize((500 + odd + beside) as usize, 20.0);
            e[700..700 + beside as usize].fill(7.0);
            let near: Vec<u32> = (0..500 + odd).chain(700..700 + beside).collect();
            let is_inlier: Vec<bool> = (0..1000).map(|k| k < 700).collect();
            let outliers = OutlierPosterior::new(&e, &near, &deviations, &is_inlier);
            assert!(outliers.keeps(0));
            outliers.keeps(500)
        };
        assert!(run(100, 0) && run(100, 100) && run(1, 0));
        assert!(!run(10, 20) && !run(10, 10) && !run(1, 1));
    }
}
