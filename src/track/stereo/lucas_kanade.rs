//! Affine motion of a cluster on its edge pixels (B. Lucas and T. Kanade, 1981), coarse to fine, robustly
//! weighted; `task` has the iterations of one cluster.

mod task;

use self::task::Task;
use super::{cluster_motion::PlaneMotion, exposure::Exposure};
use crate::image::GaussianSmoother;
use crate::types::Frame;

/// Standard deviations of the Gaussians, coarse to fine, px.
const LEVEL_SIGMAS: [f32; 4] = [8.0, 4.0, 2.0, 1.0];
/// Iterations (translation, affine) at each level before the finest, for two schedules. The rim of a growing
/// cluster moves farther than a fine level can follow, so the map is affine from the coarsest level on. A
/// cluster that leaves the view has too few pixels at coarse levels, so the second schedule begins finer.
const WAYS: [[[usize; 2]; FINE]; 2] = [[[4, 4], [3, 3], [3, 3]], [[0, 0], [4, 0], [3, 3]]];
/// Iterations (translation, affine) at the finest level.
const FINE_STEPS: [usize; 2] = [1, 6];
/// Largest number of pixels at each level: neighbours are redundant in coarse views.
const MAX_VOTERS: [usize; 4] = [200, 400, 800, usize::MAX];
/// Convergence tolerance at a level, px.
const MIN_STEP: f64 = 1e-3;
/// Floor of the standard deviation of the residual, grey levels: frames are rounded.
const MIN_NOISE_STD: f64 = 0.3;
/// Prior standard deviations: of the translation from its start, px, and of the derivatives times the cluster
/// radius over that radius.
const PRIOR_STD: [f64; 2] = [16.0, 0.15];
/// Smallest number of pixels for an affine map.
const MIN_AFFINE_PIXELS: usize = 40;
/// The finest level.
const FINE: usize = LEVEL_SIGMAS.len() - 1;
/// Truncation of residuals in comparisons, grey levels.
const MAX_RESIDUAL: f64 = 30.0;

#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct SmoothedLevels([Frame<f32>; LEVEL_SIGMAS.len()]);

impl SmoothedLevels {
    /// Smooths a frame in grey levels.
    pub fn new(frame: &Frame<f32>) -> Self {
        // Each level is smoothed from the frame itself, so that NaN does not spread farther than the kernel.
        Self(LEVEL_SIGMAS.map(|sigma| {
            GaussianSmoother::with(f64::from(sigma), 3.0, crate::image::Border::Reflect)
                .map_or_else(|_| frame.clone(), |smoother| smoother.apply(frame))
        }))
    }

    /// The frame under another exposure.
    pub fn exposed(&self, exposure: &Exposure) -> Self {
        Self(self.0.each_ref().map(|frame| exposure.applied(frame)))
    }

    /// The frame at the finest level.
    pub fn sharpest(&self) -> &Frame<f32> {
        &self.0[FINE]
    }

    /// The frame at the level before the finest: less noise, edges kept.
    pub fn smooth(&self) -> &Frame<f32> {
        &self.0[FINE - 1]
    }
}

/// Motion of pixels `(x, y)` between two smoothed frames; of several starts, px, the smallest truncated
/// residual wins. `None` for under three pixels, under half of them in view, or singular equations.
pub(super) fn affine_motion(
    before: &SmoothedLevels,
    after: &SmoothedLevels,
    pixels: &[[f64; 2]],
    starts: &[[f64; 2]],
) -> Option<PlaneMotion> {
    let task = Task::new(before, after, pixels)?;
    let mut best: Option<([f64; 6], f64)> = None;
    for (start, way) in starts.iter().flat_map(|start| {
        WAYS[..if crate::ablation::keeps("stereo.second_way") { 2 } else { 1 }].iter().map(move |way| (start, way))
    }) {
        let mut map = [start[0], start[1], 0.0, 0.0, 0.0, 0.0];
        let Some(residual) = task.go(way, &mut map, start) else { continue };
        if best.is_none_or(|(_, least)| residual < least) {
            best = Some((map, residual));
        }
    }
    let (mut map, _) = best?;
    let start = [map[0], map[1]];
    task.descend(FINE, FINE_STEPS, &mut map, &start)?;
    task.motion_of(&map)
}
