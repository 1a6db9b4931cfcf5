//! Rejection of moving objects, which are connected: their points that fit the scene's motion by chance
//! pull it towards theirs.

use super::{CompetingMotion, Consensus, MANY, MIN_POINTS, inliers_of};
use crate::math::median;
use crate::motion3d::kernels::equations;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::rows::tangents;
use crate::motion3d::solver::covariance::{direction_block, inverse};
use crate::motion3d::solver::neighbours::{Neighbours, Tree};
use crate::motion3d::solver::refine::{StoppingCriteria, refine};
use std::ops::Range;

/// Neighbours that are looked at; points from which on there are enough of them.
const NEAREST: usize = 16;
const MIN_WITH_NEIGHBOURS: usize = 64;

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

/// The neighbourhoods of all points: the nearest, or the cells of the tree where there are many.
enum Around {
    Nearest(Tree, Neighbours),
    Cells(Tree, Vec<Range<usize>>),
}

impl Around {
    fn new(observations: &Observations) -> Self {
        let tree = Tree::new(&observations.site);
        if observations.n > MANY {
            let cells = tree.cells(2 * NEAREST);
            return Self::Cells(tree, cells);
        }
        let everyone: Vec<u32> = (0..observations.n as u32).collect();
        let lists = tree.nearest(&everyone, NEAREST);
        Self::Nearest(tree, lists)
    }

    /// The share of outliers among each point's neighbours.
    fn rejected(&self, is_inlier: &[bool]) -> Vec<f64> {
        let mut shares = vec![0.0; is_inlier.len()];
        match self {
            Self::Nearest(tree, lists) => {
                for (place, &k) in tree.order().iter().enumerate() {
                    let near = lists.of(place);
                    let out = near.iter().filter(|&&near| !is_inlier[tree.order()[near as usize] as usize]).count();
                    shares[k as usize] = out as f64 / near.len() as f64;
                }
            }
            Self::Cells(tree, cells) => {
                for cell in cells {
                    let members = &tree.order()[cell.clone()];
                    let out = members.iter().filter(|&&k| !is_inlier[k as usize]).count();
                    for &k in members {
                        shares[k as usize] = out as f64 / members.len() as f64;
                    }
                }
            }
        }
        shares
    }
}

/// The inliers of which few belong to a moving object.
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
pub(crate) fn inner(observations: &Observations, found: &Consensus) -> Option<Inner> {
    if observations.n < MIN_WITH_NEIGHBOURS {
        return None;
    }
    let around = Around::new(observations);
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
pub(crate) fn more_than_usual(shares: &mut [f64]) -> f64 {
    let usual = median(shares).unwrap_or(0.0);
    let deviation = (usual.max(1.0 / NEAREST as f64) * (1.0 - usual) / NEAREST as f64).sqrt();
    usual + MORE * deviation
}

/// The motion and the inliers without those that have a larger share of rejected neighbours than is usual,
/// and which points have no larger one.
fn without(observations: &Observations, found: &Consensus, around: &Around) -> (Motion, Vec<u32>, Vec<bool>) {
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
        motion = refine(&observations.subset(&kept), motion, None, StoppingCriteria::of(observations.n)).motion;
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
