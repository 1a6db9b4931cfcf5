//! Neighbourhoods: about sixteen cells of points that lie together.

use crate::motion3d::model::observations::Observations;
use crate::motion3d::solver::neighbours::{Neighbours, Tree};
use crate::motion3d::solver::refine::MANY;
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
