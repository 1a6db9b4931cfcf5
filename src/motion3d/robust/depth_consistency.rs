//! Outliers along their epipolar line fit any motion, but not with the depth of their neighbours.
//!
//! A depth that differs from its neighbours' is no proof: few near objects before a far background are as
//! rare, and carry all of the translation. Their number decides: of outliers spread evenly, as many fit a
//! motion with such a depth as miss its epipolar line by a little more and have the same depth. Points with
//! such depths are outliers if that many explain them (the local false discovery rate; B. Efron 2001).

use super::moving_objects::more_than_usual;
use super::outlier_posterior::{BAND, Bin, DOUBLING, OutlierPosterior};
use super::{Consensus, INLIER};
use crate::math::{median, quantile};
use crate::motion3d::kernels::{Depths, depths};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::solver::neighbours::Tree;
use crate::motion3d::solver::refine::MANY;
use rayon::prelude::*;
use std::ops::Range;

/// Neighbours that a depth is compared with.
const NEAREST: usize = 16;

/// Most points of a cell.
const CELL: usize = 32;

/// Cells of one task.
const TOGETHER: usize = 64;

/// The share of the differences whose quantile measures them, and that quantile of a standard normal's size:
/// high enough for two layers of depth to stay.
const SHARE: f64 = 0.85;
const SHARE_DEVIATION: f64 = 1.44;

/// Properties of points at a motion.
pub(crate) struct Judged {
    pub outliers: OutlierPosterior,
    /// Depths drawn to the median of the neighbours', weighted by its precision; 0 of points far from their
    /// lines.
    pub smooth: Vec<f64>,
    /// Minus twice by how much, in nats, residuals and depths are likelier than those of outliers alone.
    pub cost: f64,
}

/// Rejects depths that disagree with their neighbours'.
pub(crate) struct DepthConsistency<'a> {
    observations: &'a Observations,
    /// All points by cells, where there are many.
    cells: Option<(Tree, Vec<Range<usize>>)>,
}

impl<'a> DepthConsistency<'a> {
    /// For these points.
    pub fn new(observations: &'a Observations) -> Self {
        // Of many points a depth is compared with the inliers of its cell of the tree: nearly the same
        // neighbours, found at once.
        let cells = (observations.n > MANY).then(|| {
            let tree = Tree::new(&observations.site);
            let cells = tree.cells(CELL);
            (tree, cells)
        });
        Self { observations, cells }
    }

    /// The inliers without those that outliers explain, and how likely each of the others is one.
    pub fn passed(&self, found: &Consensus) -> (Vec<u32>, Option<OutlierPosterior>) {
        let inliers = &found.inliers;
        let Some(Judged { outliers, .. }) = self.judged(&found.motion, inliers) else { return (inliers.clone(), None) };
        let kept = inliers.iter().copied().filter(|&k| outliers.keeps(k)).collect();
        (kept, Some(outliers))
    }

    /// Finds which inliers of a motion may be outliers; `None` where these are too few to have neighbours.
    pub fn judged(&self, motion: &Motion, inliers: &[u32]) -> Option<Judged> {
        if inliers.len() <= NEAREST {
            return None;
        }
        let seen = depths(self.observations, motion);
        let near = near(self.observations, &seen);
        let mut is_inlier = vec![false; self.observations.n];
        for &k in inliers {
            is_inlier[k as usize] = true;
        }
        let around = match &self.cells {
            Some((tree, cells)) => within_cells(tree, cells, &near, &is_inlier, &seen),
            None => from_nearest(self.observations, &near, &is_inlier, &seen),
        };
        let (differences, rejected): (Vec<f64>, Vec<f64>) = around.into_iter().unzip();
        let mut shares: Vec<f64> =
            near.iter().zip(&rejected).filter(|(k, _)| is_inlier[**k as usize]).map(|(_, share)| *share).collect();
        let limit = more_than_usual(&mut shares);
        let (deviations, scene) = deviations(&near, &differences, &is_inlier, &seen);
        let n = self.observations.n;
        let outliers = OutlierPosterior::new(
            n,
            seen.e[..n].iter().filter(|e| e.abs() >= BAND.start).count(),
            near.iter().zip(&deviations).zip(&rejected).map(|((&k, &deviation), &rejected)| Bin {
                point: k,
                deviation,
                is_inlier: is_inlier[k as usize],
                among: is_inlier[k as usize] && rejected > limit,
                residual: seen.e[k as usize],
            }),
        );
        let mut smooth = vec![0.0; self.observations.n];
        for ((&k, difference), deviation) in near.iter().zip(&differences).zip(&deviations) {
            let k = k as usize;
            let wide = scene * seen.s2[k];
            let share = if deviation.abs() < DOUBLING { wide / (wide + 1.0) } else { 1.0 };
            smooth[k] = seen.nu[k] - (1.0 - share) * difference;
        }
        let cost = -inliers.iter().map(|&k| outliers.gain(k as usize, seen.e[k as usize])).sum::<f64>();
        Some(Judged { outliers, smooth, cost })
    }
}

/// Points before the camera that miss their epipolar line by no more than those from which outliers are
/// counted.
fn near(observations: &Observations, seen: &Depths) -> Vec<u32> {
    let near = |&k: &u32| {
        let k = k as usize;
        seen.e[k].abs() < BAND.end && seen.nu[k] * seen.s2[k].sqrt() > -INLIER
    };
    (0..observations.n as u32).filter(near).collect()
}

/// Differences in units of what the scene and the noise allow, and the variance that is the scene's; 0 at the
/// epipole, where the depth is not known and cannot speak against the point.
fn deviations(near: &[u32], differences: &[f64], is_inlier: &[bool], seen: &Depths) -> (Vec<f64>, f64) {
    let known = |k: u32| seen.s2[k as usize] > 0.0;
    let of_inliers = || near.iter().zip(differences).filter(|(k, _)| is_inlier[**k as usize] && known(**k));
    let mut sizes: Vec<f64> = of_inliers().map(|(_, difference)| difference.abs()).collect();
    let mut variances: Vec<f64> = of_inliers().map(|(&k, _)| 1.0 / seen.s2[k as usize]).collect();
    let tau = quantile(&mut sizes, SHARE).unwrap_or(0.0) / SHARE_DEVIATION;
    let scene = (tau * tau - median(&mut variances).unwrap_or(0.0)).max(0.0);
    let unit = |k: u32| (scene + 1.0 / seen.s2[k as usize]).sqrt().max(tau);
    let deviation = |(&k, difference): (&u32, &f64)| if known(k) { difference / unit(k) } else { 0.0 };
    (near.iter().zip(differences).map(deviation).collect(), scene)
}

/// Differences of depths from the median of the inliers among their nearest points, and the share of the
/// others there.
fn from_nearest(observations: &Observations, near: &[u32], is_inlier: &[bool], seen: &Depths) -> Vec<(f64, f64)> {
    let sites: Vec<[f64; 3]> = near.iter().map(|&k| observations.site[k as usize]).collect();
    let tree = Tree::new(&sites);
    let places: Vec<u32> = (0..near.len() as u32).collect();
    let lists = tree.nearest(&places, NEAREST);
    let point = |place: u32| near[tree.order()[place as usize] as usize] as usize;
    let mut differences = vec![(0.0, 0.0); near.len()];
    let mut around = Vec::with_capacity(NEAREST);
    for place in 0..near.len() {
        around.clear();
        let inliers = lists.of(place).iter().map(|&other| point(other)).filter(|&other| is_inlier[other]);
        around.extend(inliers.map(|other| seen.nu[other]));
        differences[tree.order()[place] as usize] = {
            let rejected = 1.0 - around.len() as f64 / NEAREST as f64;
            (seen.nu[point(place as u32)] - median(&mut around).unwrap_or(0.0), rejected)
        };
    }
    differences
}

/// Differences of depths from the median of the inliers in their cell, and the share of the others there.
fn within_cells(
    tree: &Tree,
    cells: &[Range<usize>],
    near: &[u32],
    is_inlier: &[bool],
    seen: &Depths,
) -> Vec<(f64, f64)> {
    let medians: Vec<Vec<(f64, f64)>> = cells
        .par_chunks(TOGETHER)
        .map(|cells| {
            let mut depths = Vec::with_capacity(CELL);
            let middle = |cell: &Range<usize>| {
                depths.clear();
                let members = tree.order()[cell.clone()].iter().map(|&k| k as usize);
                depths.extend(members.filter(|&k| is_inlier[k]).map(|k| seen.nu[k]));
                (median(&mut depths).unwrap_or(0.0), 1.0 - depths.len() as f64 / cell.len() as f64)
            };
            cells.iter().map(middle).collect()
        })
        .collect();
    let mut middle = vec![(0.0, 0.0); is_inlier.len()];
    for (cell, median) in cells.iter().zip(medians.into_iter().flatten()) {
        for &k in &tree.order()[cell.clone()] {
            middle[k as usize] = median;
        }
    }
    let difference = |&k: &u32| (seen.nu[k as usize] - middle[k as usize].0, middle[k as usize].1);
    near.iter().map(difference).collect()
}
