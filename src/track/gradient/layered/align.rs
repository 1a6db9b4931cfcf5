//! The gradient step over the whole target: equation (5) of the paper with the unknowns of an affine map.

use super::front::Front;
use super::layers::{Background, Target};
use super::level::{Level, STEP_MAX, Vote};
use super::pose::{Increment, Pose};
use crate::math::robust_std;
use crate::types::Frame;
use nalgebra::{SMatrix, SVector};

/// Steps at a level.
const STEPS: usize = 6;
/// A level is left when a step is shorter, px.
const SETTLED: f64 = 0.01;
/// Least deviation of the residual, share of the range of the model.
const LEAST_SHARE: f64 = 0.03;
/// What turning a target changes of its picture, over what growing does, squared, below which it is round:
/// that much is noise. A square has a third.
const ROUND: f64 = 0.1;
/// What the covariance is multiplied by: neighbouring residuals are not independent.
const CORRELATED: f64 = 4.0;

type Matrix = SMatrix<f64, 6, 6>;
type Vector = SVector<f64, 6>;

/// What may change: the columns are unknowns, the rows the six entries of an increment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Freedom {
    /// Two unknowns.
    Translation,
    /// Four: `B = [[s, -r], [r, s]]`.
    Similarity,
    /// Six.
    Affine,
}

impl Freedom {
    fn unknowns(self) -> usize {
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

    fn increment(self, delta: &Vector) -> Increment {
        match self {
            Self::Translation => [delta[0], delta[1], 0.0, 0.0, 0.0, 0.0],
            Self::Similarity => [delta[0], delta[1], delta[2], -delta[3], delta[3], delta[2]],
            Self::Affine => std::array::from_fn(|k| delta[k]),
        }
    }
}

/// Which points have no vote.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Silence {
    /// All vote.
    None,
    /// Not those of the target where the known background is what is seen.
    Covered,
    /// Nor those beside it that look like it: a look-alike touches.
    Lookalike,
    /// Not those of the target where what stands in front of it is what is seen.
    Front,
    /// Not those of the half that lies in a direction, in the picture.
    Towards([f64; 2]),
}

/// A task of alignment.
#[derive(Debug, Clone, Copy)]
pub(super) struct Task<'a> {
    pub frame: &'a Frame<f64>,
    pub target: &'a Target,
    pub background: &'a Background,
    pub front: Option<&'a Front>,
    pub noise: f64,
    pub freedom: Freedom,
    pub silence: Silence,
    /// Deviations of the increment beforehand: of d, px, and of B.
    pub prior: [f64; 2],
    /// Deviations of the Gaussians, coarse to fine, px of the picture.
    pub levels: &'a [f64],
}

/// Where the target was found.
#[derive(Debug, Clone, Copy)]
pub(super) struct Aligned {
    pub pose: Pose,
    /// All steps together, about as one increment of the pose that was begun with.
    pub moved: Increment,
    /// Covariance of the position in the picture, px^2.
    pub covariance: [[f64; 2]; 2],
    /// How much of the rotation was told by the picture, 0 to 1; `None` where it was not asked.
    pub rotation_told: Option<f64>,
    /// Brightness over that of the template.
    pub gain: f64,
}

/// The residual's deviation, robustly.
fn deviation(votes: &[Vote], noise: f64, range: f64) -> f64 {
    let mut sizes: Vec<f64> = votes.iter().map(|vote| vote.residual.abs()).collect();
    robust_std(&mut sizes).unwrap_or(0.0).max(noise).max(LEAST_SHARE * range)
}

/// Weighted normal equations `J'WJ` and `J'Wr`; outliers count little (S. Geman and D. McClure).
fn normal_equations(votes: &[Vote], s: f64, unknowns: usize) -> (Matrix, Vector) {
    let (mut matrix, mut right) = (Matrix::zeros(), Vector::zeros());
    for vote in votes {
        let outlying = 1.0 + (vote.residual / (3.0 * s)).powi(2);
        let weight = vote.weight / (outlying * outlying);
        for i in 0..unknowns {
            let column = weight * vote.columns[i];
            right[i] += column * vote.residual;
            for j in i..unknowns {
                matrix[(i, j)] += column * vote.columns[j];
            }
        }
    }
    matrix.fill_lower_triangle_with_upper_triangle();
    (matrix, right)
}

/// Finds the pose from a first guess; `None` when nothing of the target is in the picture.
pub(super) fn align(task: Task<'_>, guess: &Pose, gain: f64) -> Option<Aligned> {
    let near = task.target.near();
    let unknowns = task.freedom.unknowns();
    let (mut pose, mut total, mut gain) = (*guess, Vector::zeros(), gain);
    let mut last = None;
    for &sigma in task.levels {
        let mut level = Level::new(task, &pose, sigma, &near);
        let silent = level.silent(&pose, gain);
        for _ in 0..STEPS {
            let range = level.vote(&pose, gain, silent.as_ref());
            if level.votes.len() < unknowns {
                return None;
            }
            let s = deviation(&level.votes, task.noise, range);
            let (mut matrix, right) = normal_equations(&level.votes, s, unknowns);
            let mut prior = Vector::zeros();
            for k in 0..6 {
                prior[k] = (s / task.prior[usize::from(k >= 2)]).powi(2);
                // Unknowns that there are not.
                matrix[(k, k)] += if k < unknowns { prior[k] } else { 1.0 };
            }
            let round = matrix[(3, 3)] - prior[3] < ROUND * (matrix[(2, 2)] - prior[2]);
            let inverse = matrix.cholesky()?.inverse();
            let mut delta = -(inverse * (right + prior.component_mul(&total)));
            let length = delta[0].hypot(delta[1]);
            if length > STEP_MAX {
                delta *= STEP_MAX / length;
            }
            pose = pose.moved(&task.freedom.increment(&delta));
            total += delta;
            last = Some((inverse, s, round));
            if length < SETTLED {
                break;
            }
        }
        // What stands before much of the target would be taken for its light.
        let heard = silent.as_ref().filter(|_| task.silence == Silence::Front);
        gain = level.gain(&pose, gain, heard);
    }
    let (inverse, s, round) = last?;
    if !pose.p.iter().chain(pose.a.as_flattened()).all(|value| value.is_finite()) {
        return None;
    }
    let d = pose.a;
    let inner = |i: usize, j: usize| CORRELATED * s * s * inverse[(i, j)];
    let covariance = std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            (0..2).map(|k| (0..2).map(|l| d[i][k] * inner(k, l) * d[j][l]).sum::<f64>()).sum::<f64>()
        })
    });
    let rotation_told = match task.freedom {
        Freedom::Translation => None,
        Freedom::Similarity if round => Some(0.0),
        Freedom::Similarity => Some(1.0 - s * s * inverse[(3, 3)] / task.prior[1].powi(2)),
        Freedom::Affine => Some(1.0),
    };
    Some(Aligned { pose, moved: task.freedom.increment(&total), covariance, rotation_told, gain })
}
