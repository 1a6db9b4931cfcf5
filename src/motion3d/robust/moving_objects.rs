//! Rejection of moving objects, which are connected: their points that fit the scene's motion by chance
//! pull it towards theirs.

use super::cells::{Cells, NEAREST, Neighbourhoods};
use super::{CompetingMotion, Consensus, EFFORT, MIN_POINTS, inliers_of};
use crate::math::median;
use crate::motion3d::kernels::equations;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::rows::tangents;
use crate::motion3d::solver::covariance::{direction_block, inverse};
use crate::motion3d::solver::refine::refine;

/// Points from which on there are enough neighbours.
const MIN_WITH_NEIGHBOURS: usize = 64;

/// Rejected points below which no point has more of them around it than is usual.
const MIN_REJECTED: usize = 4;

/// Deviations by which rejected neighbours must be more than usual.
const MORE: f64 = 3.0;

/// Times that points are left out and the rest is looked at again.
const ROUNDS: usize = 5;

/// The 0.999 quantile of chi-squared with two degrees of freedom, and the share of the variance of a
/// direction that is added to the difference of both variances.
const RARE: f64 = 13.8;
const BESIDES: f64 = 0.1;

/// A difference of directions, rad, that refining leaves.
const ROUNDING: f64 = 1e-7;

/// The inliers among which few points are of a moving object.
pub(crate) struct Inner {
    /// Those with few rejected neighbours; all of them, if few would be left.
    pub inliers: Vec<u32>,
    /// The motion of all inliers (where few would be left: of those few), if it is another one: then points
    /// on the border of an object belong to that.
    pub competitor: Option<CompetingMotion>,
    /// Points with few rejected neighbours; `None` if few would be left.
    pub has_inlier_neighbours: Option<Vec<bool>>,
}

/// The share of the inliers that must be left.
const MIN_LEFT: f64 = 0.5;

/// Looks at the neighbours of the inliers; `None` where that leaves all of them.
pub(crate) fn inner(observations: &Observations, found: &Consensus, cells: &Cells) -> Option<Inner> {
    if observations.n < MIN_WITH_NEIGHBOURS || observations.n - found.inliers.len() < MIN_REJECTED {
        return None;
    }
    let around = Neighbourhoods::new(cells, observations.n);
    let (motion, fewer, has_inlier_neighbours) = without(observations, found, &around);
    if fewer.len() == found.inliers.len() {
        return None;
    }
    let differ = differ(observations, found, &motion, &fewer).unwrap_or(false);
    let enough = fewer.len() as f64 >= MIN_LEFT * found.inliers.len() as f64;
    let other = if enough { found.motion } else { motion };
    let competitor = differ.then_some(CompetingMotion { motion: other, excess: 0.0, others: true });
    let inliers = if enough { fewer } else { found.inliers.clone() };
    Some(Inner { inliers, competitor, has_inlier_neighbours: enough.then_some(has_inlier_neighbours) })
}

/// From which share of rejected neighbours on there are more than is usual among these; reorders them.
fn more_than_usual(shares: &mut [f64]) -> f64 {
    let usual = median(shares).unwrap_or(0.0);
    let deviation = (usual.max(1.0 / NEAREST as f64) * (1.0 - usual) / NEAREST as f64).sqrt();
    usual + MORE * deviation
}

/// The motion and the inliers without those that have a larger share of rejected neighbours than is usual,
/// and which points have no larger one.
fn without(
    observations: &Observations,
    found: &Consensus,
    around: &Neighbourhoods<'_>,
) -> (Motion, Vec<u32>, Vec<bool>) {
    let (mut motion, mut inliers) = (found.motion, found.inliers.clone());
    let mut has_inlier_neighbours = vec![true; observations.n];
    for _ in 0..ROUNDS {
        let fitted = inliers_of(observations, &motion);
        let fitted: Vec<u32> = fitted.into_iter().filter(|k| found.inliers.binary_search(k).is_ok()).collect();
        let mut is_inlier = vec![false; observations.n];
        for &k in &fitted {
            is_inlier[k as usize] = true;
        }
        let rejected = around.rejected(&is_inlier);
        let mut shares: Vec<f64> = fitted.iter().map(|&k| rejected[k as usize]).collect();
        let limit = more_than_usual(&mut shares);
        let kept: Vec<u32> = fitted.into_iter().filter(|&k| rejected[k as usize] <= limit).collect();
        if kept == inliers || kept.len() < MIN_POINTS {
            break;
        }
        motion = refine(&observations.subset(&kept), motion, None, EFFORT).motion;
        inliers = kept;
        has_inlier_neighbours = rejected.iter().map(|&share| share <= limit).collect();
    }
    (motion, inliers, has_inlier_neighbours)
}

/// Whether the motion of `fewer` points differs from that of all inliers by more than their lower number
/// explains (J. Hausman 1978: the difference has the difference of the covariances); `None` where that is not
/// known.
fn differ(observations: &Observations, found: &Consensus, inner: &Motion, fewer: &[u32]) -> Option<bool> {
    let tangent = tangents(&found.motion.u());
    let spread = |points: &[u32]| {
        let at = equations(&observations.subset(points), &found.motion, &tangent, None);
        Some(direction_block(&inverse(&at.h)?))
    };
    let (all, some) = (spread(&found.inliers)?, spread(fewer)?);
    let off = tangent * inner.u();
    if off.norm() < ROUNDING {
        return Some(false);
    }
    let own = (some - all) + all * BESIDES;
    // Here points are in units of their own errors, of which there are fewer than points.
    Some(off.dot(&(own.try_inverse()? * off)) > RARE * observations.points_per_independent_sample)
}
