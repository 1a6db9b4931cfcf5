//! Neighbourhoods: about sixteen cells of points that lie together; and rejection of moving objects, which
//! are connected: their points that fit the scene's motion by chance pull it towards theirs.

use super::{Consensus, MIN_POINTS, STOPPING, inliers_of};
use crate::math::kd_tree::{Neighbours, Tree};
use crate::math::median;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::solver::refine::{MANY, refine};
use std::ops::Range;

/// Number of cells: an object on a tenth of the picture fills one.
const CELLS: usize = 16;
/// Bounds of the largest number of points of a cell: the median depth of fewer is too noisy, and more are not
/// needed.
const CELL_POINTS: [usize; 2] = [32, 64];

/// All points of a picture by cells.
pub(crate) struct Cells {
    tree: Tree,
    cells: Vec<Range<usize>>,
}

impl Cells {
    /// For these points.
    pub fn new(observations: &Observations) -> Self {
        let tree = Tree::new(&observations.site[..observations.n]);
        let cells = tree.cells(observations.n.div_ceil(CELLS).clamp(CELL_POINTS[0], CELL_POINTS[1]));
        Self { tree, cells }
    }

    /// Halves of the picture, halves of these and so on with at least `least` points.
    pub fn halves(&self, least: usize) -> Vec<&[u32]> {
        self.tree.halves(least).into_iter().map(|places| &self.tree.order()[places]).collect()
    }

    /// The points of each cell.
    pub fn members(&self) -> impl Iterator<Item = &[u32]> {
        self.cells.iter().map(|cell| &self.tree.order()[cell.clone()])
    }
}

/// The nearest points of each point, or its cell where there are many.
pub(crate) struct Neighbourhoods<'a> {
    cells: &'a Cells,
    nearest: Option<Neighbours>,
}

/// Points whose share of rejected neighbours is looked at.
pub(crate) const NEAREST: usize = 16;

impl<'a> Neighbourhoods<'a> {
    /// Of more than [`NEAREST`] points.
    pub fn new(cells: &'a Cells, n: usize) -> Self {
        let everyone: Vec<u32> = (0..n as u32).collect();
        let nearest = (n <= MANY).then(|| cells.tree.nearest(&everyone, NEAREST));
        Self { cells, nearest }
    }

    /// The share of each point's neighbours that are no inliers.
    pub fn rejected(&self, is_inlier: &[bool]) -> Vec<f64> {
        let mut shares = vec![0.0; is_inlier.len()];
        let order = self.cells.tree.order();
        if let Some(nearest) = &self.nearest {
            for (place, &k) in order.iter().enumerate() {
                let out = nearest.of(place).iter().filter(|&&near| !is_inlier[order[near as usize] as usize]).count();
                shares[k as usize] = out as f64 / NEAREST as f64;
            }
            return shares;
        }
        for members in self.cells.members() {
            let out = members.iter().filter(|&&k| !is_inlier[k as usize]).count();
            for &k in members {
                shares[k as usize] = out as f64 / members.len() as f64;
            }
        }
        shares
    }
}

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
