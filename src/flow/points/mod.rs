//! Flow at single points of two frames, by gradient steps on a pyramid.
//!
//! B. D. Lucas, T. Kanade, "An iterative image registration technique with an application to stereo vision",
//! 1981, in the pyramidal form of J.-Y. Bouguet, "Pyramidal implementation of the Lucas Kanade feature
//! tracker", 2000: in a square window around each point, whose brightness moves by one translation.
//!
//! Build one [`PointPyramid`] a frame and keep it: the frame after of one pair is the frame before of the
//! next. `batch` follows many points forward and back, `follow` one through the levels, `window` has the sums
//! over one window, on `rows` continued beyond the border.

mod batch;
mod follow;
mod options;
mod pyramid;
mod rows;
mod window;

pub use batch::{PointFlow, track_points};
pub use options::PointFlowOptions;
pub use pyramid::PointPyramid;
