//! What the gradient tracker is given.

use crate::types::TargetBox;

/// Changes of the target's image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub enum Shape {
    /// It rotates and grows: four unknowns. The default.
    #[default]
    Similarity,
    /// Any affine map: six unknowns, for targets that are stretched.
    Affine,
}

/// What the camera does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub enum CameraMotion {
    /// It may move: the still scene is aligned from frame to frame where that explains the frames better.
    /// The default.
    #[default]
    Auto,
    /// It stands still.
    None,
}

/// What is known of the target in the first frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Start {
    /// Nothing: the first object that moves.
    #[default]
    Motion,
    /// A point on it, `(x, y)` px: the object that moves nearest to it.
    Centre([f64; 2]),
    /// Its box.
    Box(TargetBox),
}

/// Options of the gradient tracker.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct GradientOptions {
    /// What the target may do; default similarity.
    pub shape: Shape,
    /// What the camera may do; default anything.
    pub camera: CameraMotion,
}
