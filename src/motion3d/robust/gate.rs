//! Outliers along their epipolar line obey any motion, but not with the depth of their neighbours.

use super::super::kernels::depths;
use super::super::neighbours::Tree;
use super::super::observations::{Observations, median, quantile};
use super::Consensus;

/// Neighbours that a depth is compared with.
const NEAREST: usize = 16;

/// The share of the differences whose quantile measures them, and that quantile of a standard normal's size: high enough for two layers of depth to stay.
const SHARE: f64 = 0.85;
const SHARE_DEVIATION: f64 = 1.44;

/// How many of their deviations differences may be.
const GATE: f64 = 4.0;

/// The inliers whose depth differs from the median of their 16 nearest inliers by what the scene and the noise allow.
pub(super) fn smooth_enough(observations: &Observations, found: &Consensus) -> Vec<u32> {
    let inliers = &found.inliers;
    if inliers.len() <= NEAREST {
        return inliers.clone();
    }
    let subset = observations.subset(inliers);
    let seen = depths(&subset, &found.motion);
    let tree = Tree::new(&subset.position);
    let places: Vec<u32> = (0..subset.n as u32).collect();
    let lists = tree.nearest(&places, NEAREST);
    let mut differences = vec![0.0; subset.n];
    for (place, &k) in tree.order().iter().enumerate() {
        let depth = |&near: &u32| seen.nu[tree.order()[near as usize] as usize];
        let mut around: Vec<f64> = lists.of(place).iter().map(depth).collect();
        differences[k as usize] = seen.nu[k as usize] - median(&mut around);
    }
    let known = |k: &usize| seen.s2[*k] > 0.0;
    let mut sizes: Vec<f64> = (0..subset.n).filter(known).map(|k| differences[k].abs()).collect();
    let mut variances: Vec<f64> = (0..subset.n).filter(known).map(|k| 1.0 / seen.s2[k]).collect();
    let tau = quantile(&mut sizes, SHARE) / SHARE_DEVIATION;
    let scene = (tau * tau - median(&mut variances)).max(0.0);
    let allowed = |k: usize| GATE * (scene + 1.0 / seen.s2[k]).sqrt().max(tau);
    // At the epipole the depth is not known and cannot speak against the point.
    let keeps = |k: &usize| seen.s2[*k] <= 0.0 || differences[*k].abs() <= allowed(*k);
    (0..subset.n).filter(keeps).map(|k| inliers[k]).collect()
}
