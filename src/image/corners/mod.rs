//! Corners: pixels whose surroundings change brightness along both axes, so that their motion can be seen.
//!
//! J. Shi, C. Tomasi, "Good features to track", CVPR 1994.

mod score;
mod select;

pub use score::{CORNER_WINDOW, corner_score, corner_score_into};
pub use select::{CornerOptions, select_corners};
