//! Rejection of moving objects, which are connected: their points that fit the scene's motion by chance
//! pull it towards theirs.

use super::cells::{Cells, NEAREST, Neighbourhoods};
use super::{Consensus, MIN_POINTS, STOPPING, inliers_of};
use crate::math::median;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::solver::refine::refine;

/// Points from which on there are enough neighbours.
const MIN_WITH_NEIGHBOURS: usize = 64;

/// Rejected points below which no point has more of them around it than is usual.
const MIN_REJECTED: usize = 4;

/// Standard deviations by which rejected neighbours must be more than usual.
const MORE: f64 = 3.0;

/// Times that points are left out and the rest is looked at again.
const ROUNDS: usize = 5;

/// The share of the inliers that must be left.
const MIN_LEFT: f64 = 0.5;

/// The inliers among which few points are of a moving object.
pub(crate) struct Inner {
    /// Those with few rejected neighbours.
    pub inliers: Vec<u32>,
    /// Points with few rejected neighbours.
    pub has_inlier_neighbours: Vec<bool>,
}

/// Leaves out the inliers with many rejected neighbours; `None` where that leaves all or few of them.
pub(crate) fn inner(observations: &Observations, found: &Consensus, cells: &Cells) -> Option<Inner> {
    if observations.n < MIN_WITH_NEIGHBOURS || observations.n - found.inliers.len() < MIN_REJECTED {
        return None;
    }
    let around = Neighbourhoods::new(cells, observations.n);
    let (inliers, has_inlier_neighbours) = without(observations, found, &around);
    let (all, left) = (found.inliers.len(), inliers.len());
    (left < all && left as f64 >= MIN_LEFT * all as f64).then_some(Inner { inliers, has_inlier_neighbours })
}

/// From which share of rejected neighbours on there are more than is usual among these; reorders them.
fn more_than_usual(shares: &mut [f64]) -> f64 {
    let usual = median(shares).unwrap_or(0.0);
    let deviation = (usual.max(1.0 / NEAREST as f64) * (1.0 - usual) / NEAREST as f64).sqrt();
    usual + MORE * deviation
}

/// The inliers without those that have a larger share of rejected neighbours than is usual, and which points
/// have no larger one.
fn without(observations: &Observations, found: &Consensus, around: &Neighbourhoods<'_>) -> (Vec<u32>, Vec<bool>) {
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
        motion = refine(&observations.subset(&kept), motion, STOPPING).motion;
        inliers = kept;
        has_inlier_neighbours = rejected.iter().map(|&share| share <= limit).collect();
    }
    (inliers, has_inlier_neighbours)
}
