//! What an alignment is given: layers, what may change, and which points have no vote.

use super::{layers::Background, layers::Target, pose::Increment};
use crate::types::Frame;
use nalgebra::{SMatrix, SVector};

pub(super) type Matrix = SMatrix<f64, 6, 6>;
pub(super) type Vector = SVector<f64, 6>;

/// What may change: the columns are unknowns, the rows the six entries of an increment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(super) enum MotionModel {
    /// Two unknowns.
    Translation,
    /// Four: `B = [[s, -r], [r, s]]`.
    Similarity,
    /// Six.
    Affine,
}

impl MotionModel {
    pub fn unknowns(self) -> usize {
        match self {
            Self::Translation => 2,
            Self::Similarity => 4,
            Self::Affine => 6,
        }
    }

    /// Derivatives by the unknowns, from the gradient and the place.
    #[inline(always)]
    pub fn columns(self, [gx, gy]: [f64; 2], [xi, eta]: [f64; 2]) -> [f64; 6] {
        match self {
            Self::Translation => [gx, gy, 0.0, 0.0, 0.0, 0.0],
            Self::Similarity => [gx, gy, xi * gx + eta * gy, xi * gy - eta * gx, 0.0, 0.0],
            Self::Affine => [gx, gy, xi * gx, eta * gx, xi * gy, eta * gy],
        }
    }

    pub fn increment(self, delta: &Vector) -> Increment {
        match self {
            Self::Translation => [delta[0], delta[1], 0.0, 0.0, 0.0, 0.0],
            Self::Similarity => [delta[0], delta[1], delta[2], -delta[3], delta[3], delta[2]],
            Self::Affine => std::array::from_fn(|k| delta[k]),
        }
    }
}

/// Which points have no vote.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum VoteMask {
    /// All vote.
    None,
    /// Not those of the target where the known background is what is seen.
    Occluded,
    /// Nor those beside it that look like it: a look-alike touches.
    LookAlike,
    /// Not those of the half that lies in a direction, in the picture.
    Towards([f64; 2]),
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Task<'a> {
    pub frame: &'a Frame<f64>,
    pub target: &'a Target,
    pub background: &'a Background,
    pub noise: f64,
    pub motion_model: MotionModel,
    pub vote_mask: VoteMask,
    /// Standard deviations of the increment beforehand: of d, px, and of B.
    pub prior: [f64; 2],
    /// Standard deviations of the Gaussians, coarse to fine, px of the picture.
    pub levels: &'a [f64],
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Vote {
    pub residual: f64,
    pub weight: f64,
    pub columns: [f64; 6],
}
