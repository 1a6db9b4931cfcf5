//! Result of a step, and a track.

use super::graph::Node;

/// All clusters of a step and the edge pixels they are made of.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// Step, from 0.
    pub time: usize,
    /// Time since the first step, in the unit of the tracker's `step_time`: by default steps, and the same
    /// number where none is late or early.
    pub clock: f64,
    /// Clusters with edge pixels, by component.
    pub clusters: Vec<Node>,
    /// Rows of the N edge pixels with a disparity, px.
    pub rows: Vec<u32>,
    /// Their columns, px.
    pub columns: Vec<u32>,
    /// Their disparities, px.
    pub disparities: Vec<f32>,
    /// The component that each belongs to.
    pub labels: Vec<u32>,
    /// Disparities that no layer of the grid holds, which take no part.
    pub left_out: usize,
    /// How many rows lower the right view shows a point, px, as the views were matched; none where
    /// disparities were given.
    pub row_offset: Option<f64>,
    /// Whether it was searched and the views disagree with it, see
    /// [`EdgeDisparity`](crate::stereo::EdgeDisparity::rows_doubtful).
    pub rows_doubtful: bool,
    /// Iterations of the mixture; 0 without edge pixels.
    pub rounds: usize,
}

/// One track.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Track {
    /// Steps at which it was seen, ascending.
    pub times: Vec<usize>,
    /// When these were, [`Step::clock`].
    pub clock: Vec<f64>,
    /// Mean `(x, y, d)` there, px.
    pub positions: Vec<[f64; 3]>,
    /// Motion `(u, v, w)` since the step before, px for each unit of time; NaN where not measured.
    pub velocities: Vec<[f64; 3]>,
}
