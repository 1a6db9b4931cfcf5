//! Moving objects in stereo sequences, from disparity and luminance fused in a mixture of Gaussians.
//!
//! Source: the stereo paper, "tracking of moving objects in stereo sequences by fusing disparity and
//! luminance" (variational mixture of Gaussians). A pair of views passes the files in this order:
//!
//! * [`voxels`]: edge pixels with a disparity, counted in voxels of (x, y, d);
//! * [`cell_luminance`], [`lucas_kanade`]: the left view reduced to cells, and smoothed at four levels;
//! * [`measured_motion`]: [`cluster_motion`] of the last step's clusters, under the [`exposure`] of this one,
//!   and its [`depth_change`] (paper mode: [`cell_motion`], after the clusters);
//! * [`warm_start`]: the mixture carried to this step, new seeds, split and merge;
//! * [`clusters`]: voxels and pixels of each component; [`overlap`] with the last step; [`succession`];
//! * [`association`]: which track each component is, over time gaps of the [`clock`];
//! * [`own_pixels`], [`grouping`], [`graph`], [`step`]: middles, objects, arcs and the result.
//!
//! [`tracker`] calls them with its [`options`]. All results refer to the left view: positions `(x, y)` px,
//! disparity `d = x_left - x_right` (near is large), motion `(u, v)` px/step and `w` disparity/step.
//! [`StereoMode::Paper`] is the paper's text; [`StereoMode::Improved`] measures motion to fractions of a
//! pixel first and carries the clusters along. Model and limits: `docs/stereo_tracker.md`.

mod association;
mod cell_luminance;
mod cell_motion;
mod clock;
mod cluster_motion;
mod clusters;
mod depth_change;
mod exposure;
mod graph;
mod grouping;
mod lucas_kanade;
mod measured_motion;
mod options;
mod overlap;
mod own_pixels;
mod step;
mod succession;
mod tracker;
mod voxels;
mod warm_start;

pub use graph::{Arc, Node, TrackGraph};
pub use options::{ARC_THRESHOLD, StereoCamera, StereoMode, StereoTrackerOptions, VoxelGrid};
pub use step::{Step, Track};
pub use tracker::StereoTracker;
pub use voxels::EdgePoints;
