//! The gradient step over the whole target: equation (5) of the paper with the unknowns of an affine map.

use super::level::{Level, STEP_MAX};
use super::pose::Pose;
use super::task::{Matrix, MotionModel, Task, Vector, Vote};
use crate::math::robust_std;

/// Steps at a level.
const MAX_STEPS: usize = 6;
/// A level is left when a step is shorter, px.
const MIN_STEP: f64 = 0.01;
/// Least standard deviation of the residual, share of the range of the model.
const MIN_STD_PER_RANGE: f64 = 0.03;
/// What turning a target changes of its picture, over what growing does, squared, below which it is round:
/// that much is noise. A square has a third.
const MAX_ROUND_INFORMATION: f64 = 0.1;
/// What the covariance is multiplied by: neighbouring residuals are not independent.
const CORRELATION_FACTOR: f64 = 4.0;

#[derive(Debug, Clone, Copy)]
pub(super) struct Alignment {
    pub pose: Pose,
    /// Covariance of the position in the picture, px^2.
    pub covariance: [[f64; 2]; 2],
    /// How much of the rotation the picture determines, 0 to 1; `None` where it was not estimated.
    pub rotation_observable: Option<f64>,
    /// Brightness over that of the template.
    pub gain: f64,
}

fn deviation(votes: &[Vote], noise: f64, range: f64) -> f64 {
    let mut sizes: Vec<f64> = votes.iter().map(|vote| vote.residual.abs()).collect();
    (robust_std(&mut sizes).unwrap_or(0.0)).max(noise).max(MIN_STD_PER_RANGE * range)
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
pub(super) fn align(task: Task<'_>, guess: &Pose, gain: f64) -> Option<Alignment> {
    let near = task.target.near();
    let unknowns = task.motion_model.unknowns();
    let (mut pose, mut total, mut gain) = (*guess, Vector::zeros(), gain);
    let mut last = None;
    for &sigma in task.levels {
        let mut level = Level::new(task, &pose, sigma, &near);
        let silent = level.silent(&pose, gain);
        for _ in 0..MAX_STEPS {
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
            let round = crate::ablation::keeps("gradient.round")
                && matrix[(3, 3)] - prior[3] < MAX_ROUND_INFORMATION * (matrix[(2, 2)] - prior[2]);
            let inverse = matrix.cholesky()?.inverse();
            let mut delta = -(inverse * (right + prior.component_mul(&total)));
            let length = delta[0].hypot(delta[1]);
            if length > STEP_MAX {
                delta *= STEP_MAX / length;
            }
            pose = pose.moved(&task.motion_model.increment(&delta));
            total += delta;
            last = Some((inverse, s, round));
            if length < MIN_STEP {
                break;
            }
        }
        // Of a target of which part was never seen, what hides it would count as its brightness.
        if silent.is_none() || task.target.fresh.is_none() || !crate::ablation::keeps("gradient.emerging") {
            gain = level.gain(&pose, gain);
        }
    }
    let (inverse, s, round) = last?;
    if !pose.p.iter().chain(pose.a.as_flattened()).all(|value| value.is_finite()) {
        return None;
    }
    let d = pose.a;
    let inner = |i: usize, j: usize| CORRELATION_FACTOR * s * s * inverse[(i, j)];
    let covariance = std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            (0..2).map(|k| (0..2).map(|l| d[i][k] * inner(k, l) * d[j][l]).sum::<f64>()).sum::<f64>()
        })
    });
    let rotation_observable = match task.motion_model {
        MotionModel::Translation => None,
        MotionModel::Similarity if round => Some(0.0),
        MotionModel::Similarity => Some(1.0 - s * s * inverse[(3, 3)] / task.prior[1].powi(2)),
        MotionModel::Affine => Some(1.0),
    };
    Some(Alignment { pose, covariance, rotation_observable, gain })
}
