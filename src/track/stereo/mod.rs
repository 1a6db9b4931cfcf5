//! Moving objects in stereo sequences, from disparity and luminance fused in a mixture of Gaussians.
//!
//! Source: the stereo paper, "tracking of moving objects in stereo sequences by fusing disparity and
//! luminance" (variational mixture of Gaussians). Edge pixels with a disparity are counted in voxels of (x,
//! y, d); a mixture clusters the voxels, weighted by their counts; each cluster is followed to the next step
//! in the picture and in depth; overlaps in both directions of time are arcs of a graph of clusters, whose
//! chains are the tracks. Cameras may move, nothing is learnt beforehand.
//!
//! Everything is told in the left view: positions `(x, y)` px, disparity `d = x_left - x_right` (near is
//! large), motion `(u, v)` px/step and `w` disparity/step. [`StereoMode::Paper`] is the paper's text;
//! [`StereoMode::Improved`] measures motion to fractions of a pixel first and carries the clusters along.

mod cell_luminance;
mod clusters;
mod disparity_change;
mod exposure;
mod fine_motion;
mod graph;
mod grouping;
mod identity;
mod lucas_kanade;
mod measured_motion;
mod moment;
mod motion;
mod options;
mod overlap;
mod own_pixels;
mod settings;
mod step;
mod succession;
mod tracker;
mod voxels;
mod warm_start;

pub use graph::{Arc, Node, TrackGraph};
pub use options::{Grouping, Recognition, StereoCamera, StereoMode, StereoTrackerOptions, VoxelGrid};
pub use step::{Step, Track};
pub use tracker::StereoTracker;
pub use voxels::EdgePoints;
