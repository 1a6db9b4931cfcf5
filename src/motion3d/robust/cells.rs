//! Neighbourhoods: about sixteen cells of points that lie together.

use crate::math::kd_tree::Tree;
use crate::motion3d::model::observations::Observations;
use std::ops::Range;

/// Number of cells: an object on a tenth of the picture fills one.
const CELLS: usize = 16;
/// Bounds of the largest number of points of a cell: the median depth of fewer is too noisy, and more are not
/// needed.
const CELL_POINTS: [usize; 2] = [32, 64];

/// Points whose share of rejected ones is looked at.
const NEAREST: usize = 16;

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

    /// The share of each point's nearest ones that are no inliers: by cells that are as small.
    pub fn rejected(&self, is_inlier: &[bool]) -> Vec<f64> {
        let (mut shares, order) = (vec![0.0; is_inlier.len()], self.tree.order());
        for places in self.tree.cells(NEAREST) {
            let members = &order[places];
            let out = members.iter().filter(|&&k| !is_inlier[k as usize]).count();
            for &k in members {
                shares[k as usize] = out as f64 / members.len() as f64;
            }
        }
        shares
    }
}
