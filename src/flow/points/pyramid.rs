//! A frame with its halved copies.

use crate::image::{halve, halved_size};
use crate::simd::Level;
use crate::types::Frame;

/// Smallest side of a halved frame that is still made, px: less than the smallest window.
const MIN_SIDE: usize = 3;

/// A frame and its smoothed, halved copies: pixel `i` of a level lies at pixel `2 i` of the one below it.
///
/// P. J. Burt, E. H. Adelson, "The Laplacian pyramid as a compact image code", 1983, with a Gaussian of 1 px.
/// A NaN spreads to the pixels of the coarser levels whose kernel (7 x 7) reaches it.
#[derive(Debug, Clone, PartialEq)]
pub struct PointPyramid {
    /// Full size first; never empty.
    planes: Vec<Frame<f32>>,
}

impl PointPyramid {
    /// The pyramid of `frame` (grey levels) with `levels` levels, the frame itself among them; fewer where a
    /// side would fall below 3 px. Vectorised and parallel over bands of rows.
    pub fn new(frame: Frame<f32>, levels: usize) -> Self {
        let (simd, mut planes) = (Level::detect(), vec![frame]);
        while planes.len() < levels {
            let finer = &planes[planes.len() - 1];
            let (width, height) = halved_size(finer.size());
            if width.min(height) < MIN_SIDE {
                break;
            }
            planes.push(halve(simd, finer));
        }
        Self { planes }
    }

    /// The frame at full size.
    pub fn frame(&self) -> &Frame<f32> {
        &self.planes[0]
    }

    /// `(width, height)` of the full size.
    pub fn size(&self) -> (usize, usize) {
        self.planes[0].size()
    }

    /// All levels, full size first.
    pub(super) fn planes(&self) -> &[Frame<f32>] {
        &self.planes
    }
}
