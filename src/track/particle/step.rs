//! Result of each frame.

use crate::types::TrackState;

/// The targets at one frame, with the background's motion and the corner tracks.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ParticleStep {
    /// Index of the frame, 0 for the one that the tracker began with.
    pub frame: usize,
    /// The K targets, in ascending order of their ids.
    pub targets: Vec<ParticleTarget>,
    /// K x K, row-major: which targets are near each other.
    pub near: Vec<bool>,
    /// Motion of the background since the frame before, `(x', y') = A (x, y, 1)`, px; identity in paper mode.
    pub camera: [[f64; 3]; 2],
    /// Corner tracks followed from the frame before.
    pub tracks: Vec<CornerTrack>,
}

/// One target at one frame.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ParticleTarget {
    /// The number it was added with.
    pub id: u64,
    /// Box, position, velocity and status; covariance of position and velocity along each axis.
    pub state: TrackState,
    /// Width and height, px.
    pub size: [f64; 2],
    /// Covariance of the particles: centre x, y (px), velocity u, v (px/frame), width, height (px).
    pub covariance: [[f64; 6]; 6],
    /// 1 / sum of squared weights, before the particles are drawn again.
    pub effective_sample_size: f64,
    /// Similarity of the colours to those of the first frame, .9 quantile over the particles, 0 to 1.
    pub similarity: f64,
    /// How many corner tracks belong to the target.
    pub n_tracks: usize,
    /// Whether no particle had a weight: the estimate is then the prediction.
    pub degenerate: bool,
}

/// A corner that was followed from the frame before.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct CornerTrack {
    /// Its number.
    pub id: u64,
    /// Where it is, `(x, y)` px.
    pub position: [f64; 2],
    /// Its motion relative to the background, px/frame.
    pub residual: [f64; 2],
    /// Probability of not being background.
    pub foreground: f64,
    /// The target that it belongs to.
    pub owner: Option<u64>,
}
