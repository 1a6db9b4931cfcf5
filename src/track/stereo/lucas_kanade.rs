//! Affine motion of a cluster on its edge pixels (B. Lucas and T. Kanade, 1981), coarse to fine, robustly
//! weighted; section 6.4 of the stereo tracker's design.

mod task;
mod visible;

pub(super) use visible::visible_motion;

use self::task::Task;
use super::exposure::Exposure;
use crate::image::GaussianSmoother;
use crate::math::median;
use crate::types::{AffineFlow, Frame};

/// Deviations of the Gaussians, coarse to fine, px.
const SIGMAS: [f32; 4] = [8.0, 4.0, 2.0, 1.0];
/// Ways to the finest level: steps with a translation, and after those with an affine map, at each level
/// before it. Of what grows the rim moves farther than a fine level can follow: the map has to be affine from
/// the coarsest one on. Of what is about to leave the picture too little is seen there, and less says more.
const WAYS: [[[usize; 2]; FINE]; 2] = [[[4, 4], [3, 3], [3, 3]], [[0, 0], [4, 0], [3, 3]]];
/// Those at the finest level.
const FINE_STEPS: [usize; 2] = [1, 6];
/// Most pixels that vote at each level: neighbours say the same in coarse pictures.
const VOTERS: [usize; 4] = [200, 400, 800, usize::MAX];
/// A step shorter than this, px, is the last one at its level.
const SETTLED: f64 = 1e-3;
/// Least deviation of the residual, grey levels: frames are rounded.
const LEAST_DEVIATION: f64 = 0.3;
/// Mean absolute deviation from the median, to the deviation of a normal distribution.
const MAD: f64 = 1.4826;
/// Deviation beforehand of a translation from its start, px, and of what the derivatives change within the
/// cluster's radius over that radius.
const PRIOR: [f64; 2] = [16.0, 0.15];
/// Pixels that an affine map needs.
const AFFINE_PIXELS: usize = 40;
/// The finest level.
const FINE: usize = SIGMAS.len() - 1;
/// Where residuals are truncated for comparison, grey levels.
const TRUNCATED: f64 = 30.0;

/// A frame smoothed at every level.
#[derive(Debug, Clone)]
pub(super) struct SmoothedLevels([Frame<f32>; SIGMAS.len()]);

impl SmoothedLevels {
    /// Smooths a frame in grey levels.
    pub fn new(frame: &Frame<f32>) -> Self {
        // Deviations of this size are always taken; each level is smoothed from the frame itself, so that NaN
        // stays where it reaches.
        Self(SIGMAS.map(|sigma| {
            GaussianSmoother::with(f64::from(sigma), 3.0, crate::image::Border::Reflect)
                .map_or_else(|_| frame.clone(), |smoother| smoother.apply(frame))
        }))
    }

    /// The same frame under another exposure.
    pub fn exposed(&self, exposure: &Exposure) -> Self {
        Self(self.0.each_ref().map(|frame| exposure.applied(frame)))
    }

    /// The frame with all its edges, as at the finest level.
    pub fn sharpest(&self) -> &Frame<f32> {
        &self.0[FINE]
    }

    /// The frame with what noise there is averaged out, but not yet the edges.
    pub fn smooth(&self) -> &Frame<f32> {
        &self.0[FINE - 1]
    }
}

/// A motion in the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PlaneMotion {
    /// Flow and derivatives at the centre.
    pub flow: AffineFlow<f64>,
    /// Medians of the pixels along x and y, px.
    pub centre: [f64; 2],
    /// Truncated mean absolute difference left, grey levels.
    pub residual: f64,
    /// Deviation of the difference left, from its median, grey levels.
    pub deviation: f64,
}

impl PlaneMotion {
    /// Where a pixel goes, px.
    pub fn moved(&self, x: f64, y: f64) -> [f64; 2] {
        let (u, v) = self.flow.at_offset(x - self.centre[0], y - self.centre[1]);
        [x + u, y + v]
    }
}

/// Finds the motion of pixels `(x, y)` between two smoothed frames from the best of some first guesses of the
/// translation, px.
///
/// `None` where fewer than half of the pixels stay in the picture, there are fewer than three, or the
/// equations have no solution.
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
    task.told(&map)
}

/// Medians of the pixels along x and y: unlike their mean, stray pixels hardly move them.
pub(super) fn middle(pixels: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|i| {
        let mut along: Vec<f64> = pixels.iter().map(|pixel| pixel[i]).collect();
        median(&mut along).unwrap_or(f64::NAN)
    })
}

#[cfg(test)]
mod tests;
