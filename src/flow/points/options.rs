//! Options of the flow at points.

use crate::error::{Error, Result};
use crate::simd::Level;

/// Largest accepted side of the window, px.
const MAX_WINDOW: usize = 255;

/// Options of [`track_points`](super::track_points).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointFlowOptions {
    /// Levels of the pyramid that are used, the full size among them, >= 1. Default 3.
    pub levels: usize,
    /// Side of the square window, px at every level, odd, 3 to 255. Default 19.
    pub window: usize,
    /// Maximum number of gradient steps at each level. Default 30.
    pub max_steps: usize,
    /// A step shorter than this ends the iteration at the level, px of the level. Default 0.02.
    pub min_step: f64,
    /// Maximum distance between a point and where the flow back from its new position leads, px. Infinite:
    /// not tested, which halves the work. Default 0.7.
    pub forward_backward: f64,
    /// Minimum of the smaller eigenvalue of the window's mean structure tensor, (grey levels / px)^2. Default
    /// 0.1, the 1e-4 of OpenCV's `calcOpticalFlowPyrLK` in these units.
    pub min_eigenvalue: f64,
    /// Instruction set; `None`: the best of this processor.
    pub simd: Option<Level>,
}

impl Default for PointFlowOptions {
    fn default() -> Self {
        Self {
            levels: 3,
            window: 19,
            max_steps: 30,
            min_step: 0.02,
            forward_backward: 0.7,
            min_eigenvalue: 0.1,
            simd: None,
        }
    }
}

impl PointFlowOptions {
    /// Rejects values outside the ranges above.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the option.
    pub fn check(&self) -> Result<()> {
        if self.levels == 0 {
            return Err(Error::argument("levels", "an integer >= 1", 0));
        }
        if self.window.is_multiple_of(2) || !(3..=MAX_WINDOW).contains(&self.window) {
            return Err(Error::argument("window", format!("an odd integer from 3 to {MAX_WINDOW}"), self.window));
        }
        if self.max_steps == 0 {
            return Err(Error::argument("max_steps", "an integer >= 1", 0));
        }
        for (name, value) in [
            ("min_step", self.min_step),
            ("forward_backward", self.forward_backward),
            ("min_eigenvalue", self.min_eigenvalue),
        ] {
            if value.is_nan() || value < 0.0 {
                return Err(Error::argument(name, "a number >= 0", value));
            }
        }
        Level::check(self.simd).map(|_| ())
    }
}
