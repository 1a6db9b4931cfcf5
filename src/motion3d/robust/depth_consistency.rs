//! Outliers along their epipolar line fit any motion, but not with the depth of their neighbours.
//!
//! A depth that differs from its neighbours' is no proof, as few near objects before a far background are as
//! rare. The number decides: of outliers spread evenly, as many fit a motion with such a depth as miss its
//! epipolar line by a little more (the local false discovery rate; B. Efron 2001).

use super::outlier_posterior::{BAND, DOUBLING, OutlierPosterior};
use super::{Consensus, INLIER};
use crate::math::{median, quantile};
use crate::motion3d::kernels::{Depths, depths};
use crate::motion3d::model::{motion::Motion, observations::Observations};
use crate::scattered::Tree;
use std::ops::Range;

/// Neighbours that a depth is compared with, and whose share of rejected ones is looked at.
const NEAREST: usize = 16;

/// Quantile of the differences that measures them, high enough for two layers of depth to stay; that of a
/// standard normal's size.
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

/// Number of cells: an object on a tenth of the picture fills one.
const CELLS: usize = 16;
/// Bounds of the largest number of points of a cell: the median depth of fewer is too noisy, and more are not
/// needed.
const CELL_POINTS: [usize; 2] = [32, 64];

/// Rejects depths that disagree with those of the inliers in the same cell of the picture.
pub(crate) struct DepthConsistency<'a> {
    observations: &'a Observations,
    tree: Tree,
    cells: Vec<Range<usize>>,
}

impl<'a> DepthConsistency<'a> {
    /// For these points.
    pub fn new(observations: &'a Observations) -> Self {
        let tree = Tree::new(&observations.site[..observations.n]);
        let cells = tree.cells(observations.n.div_ceil(CELLS).clamp(CELL_POINTS[0], CELL_POINTS[1]));
        Self { observations, tree, cells }
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
        let (n, seen) = (self.observations.n, depths(self.observations, motion));
        let near = near(self.observations, &seen);
        let is_inlier = self.observations.mask(inliers);
        let differences = self.within_cells(&near, &is_inlier, &seen);
        let (deviations, scene) = deviations(&near, &differences, &is_inlier, &seen);
        let outliers = OutlierPosterior::new(&seen.e[..n], &near, &deviations, &is_inlier);
        let mut smooth = vec![0.0; n];
        for ((&k, difference), deviation) in near.iter().zip(&differences).zip(&deviations) {
            let k = k as usize;
            let wide = scene * seen.s2[k];
            let share = if deviation.abs() < DOUBLING { wide / (wide + 1.0) } else { 1.0 };
            smooth[k] = seen.nu[k] - (1.0 - share) * difference;
        }
        let cost = -inliers.iter().map(|&k| outliers.gain(k as usize, seen.e[k as usize])).sum::<f64>();
        Some(Judged { outliers, smooth, cost })
    }

    /// Halves of the picture, halves of these and so on with at least `least` points.
    pub fn halves(&self, least: usize) -> Vec<&[u32]> {
        self.tree.halves(least).into_iter().map(|places| &self.tree.order()[places]).collect()
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

    /// Differences of depths from the median of the inliers in their cell.
    fn within_cells(&self, near: &[u32], is_inlier: &[bool], seen: &Depths) -> Vec<f64> {
        let mut around = vec![0.0; is_inlier.len()];
        for cell in &self.cells {
            let members = &self.tree.order()[cell.clone()];
            let inliers = members.iter().map(|&k| k as usize).filter(|&k| is_inlier[k]);
            let usual = median(&mut inliers.map(|k| seen.nu[k]).collect::<Vec<f64>>()).unwrap_or(0.0);
            for &k in members {
                around[k as usize] = usual;
            }
        }
        near.iter().map(|&k| seen.nu[k as usize] - around[k as usize]).collect()
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
