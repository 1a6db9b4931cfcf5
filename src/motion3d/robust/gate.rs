//! Outliers along their epipolar line obey any motion, but not with the depth of their neighbours.

use super::super::kernels::{Depths, depths};
use super::super::neighbours::Tree;
use super::super::observations::{Observations, median, quantile};
use super::Consensus;
use rayon::prelude::*;
use std::ops::Range;

/// Neighbours that a depth is compared with.
const NEAREST: usize = 16;

/// From here on a depth is compared with the inliers of its cell of the tree instead, of at most so many points: nearly the same neighbours, found at once.
const MANY: usize = 4000;
const CELL: usize = 32;

/// Cells of one task.
const TOGETHER: usize = 64;

/// The share of the differences whose quantile measures them, and that quantile of a standard normal's size: high enough for two layers of depth to stay.
const SHARE: f64 = 0.85;
const SHARE_DEVIATION: f64 = 1.44;

/// How many of their deviations differences may be.
const GATE: f64 = 4.0;

/// Tells depths that do not fit among their neighbours'.
pub(super) struct Gate<'a> {
    observations: &'a Observations,
    /// All points by cells, where there are many.
    cells: Option<(Tree, Vec<Range<usize>>)>,
}

impl<'a> Gate<'a> {
    /// For these points.
    pub fn new(observations: &'a Observations) -> Self {
        let cells = (observations.n > MANY).then(|| {
            let tree = Tree::new(&observations.site);
            let cells = tree.cells(CELL);
            (tree, cells)
        });
        Self { observations, cells }
    }

    /// The inliers whose depth differs from the median of their neighbours' among them by what the scene and the noise allow.
    pub fn passed(&self, found: &Consensus) -> Vec<u32> {
        let inliers = &found.inliers;
        if inliers.len() <= NEAREST {
            return inliers.clone();
        }
        let seen = depths(self.observations, &found.motion);
        let differences = match &self.cells {
            Some((tree, cells)) => within_cells(tree, cells, inliers, &seen),
            None => from_nearest(self.observations, inliers, &seen),
        };
        let known = |k: u32| seen.s2[k as usize] > 0.0;
        let mut sizes: Vec<f64> =
            inliers.iter().zip(&differences).filter(|(k, _)| known(**k)).map(|(_, d)| d.abs()).collect();
        let mut variances: Vec<f64> =
            inliers.iter().filter(|k| known(**k)).map(|&k| 1.0 / seen.s2[k as usize]).collect();
        let tau = quantile(&mut sizes, SHARE) / SHARE_DEVIATION;
        let scene = (tau * tau - median(&mut variances)).max(0.0);
        let allowed = |k: u32| GATE * (scene + 1.0 / seen.s2[k as usize]).sqrt().max(tau);
        // At the epipole the depth is not known and cannot speak against the point.
        let keeps = |(k, difference): (&u32, &f64)| !known(*k) || difference.abs() <= allowed(*k);
        inliers.iter().zip(&differences).filter(|pair| keeps(*pair)).map(|(&k, _)| k).collect()
    }
}

/// Differences of the inliers' depths from the median of their nearest inliers'.
fn from_nearest(observations: &Observations, inliers: &[u32], seen: &Depths) -> Vec<f64> {
    let sites: Vec<[f64; 3]> = inliers.iter().map(|&k| observations.site[k as usize]).collect();
    let tree = Tree::new(&sites);
    let places: Vec<u32> = (0..inliers.len() as u32).collect();
    let lists = tree.nearest(&places, NEAREST);
    let depth = |place: u32| seen.nu[inliers[tree.order()[place as usize] as usize] as usize];
    let mut differences = vec![0.0; inliers.len()];
    let mut around = Vec::with_capacity(NEAREST);
    for place in 0..inliers.len() {
        around.clear();
        around.extend(lists.of(place).iter().map(|&near| depth(near)));
        differences[tree.order()[place] as usize] = depth(place as u32) - median(&mut around);
    }
    differences
}

/// Differences of the inliers' depths from the median of the inliers in their cell.
fn within_cells(tree: &Tree, cells: &[Range<usize>], inliers: &[u32], seen: &Depths) -> Vec<f64> {
    let mut obeys = vec![false; tree.order().len()];
    for &k in inliers {
        obeys[k as usize] = true;
    }
    let medians: Vec<Vec<f64>> = cells
        .par_chunks(TOGETHER)
        .map(|cells| {
            let mut depths = Vec::with_capacity(CELL);
            let middle = |cell: &Range<usize>| {
                depths.clear();
                let members = tree.order()[cell.clone()].iter().map(|&k| k as usize);
                depths.extend(members.filter(|&k| obeys[k]).map(|k| seen.nu[k]));
                median(&mut depths)
            };
            cells.iter().map(middle).collect()
        })
        .collect();
    let mut middle = vec![0.0; obeys.len()];
    for (cell, median) in cells.iter().zip(medians.into_iter().flatten()) {
        for &k in &tree.order()[cell.clone()] {
            middle[k as usize] = median;
        }
    }
    inliers.iter().map(|&k| seen.nu[k as usize] - middle[k as usize]).collect()
}
