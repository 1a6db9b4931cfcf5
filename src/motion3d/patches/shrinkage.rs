//! The estimating equation with surfaces drawn to their distribution over the patches.

use super::system::System;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::rows::tangents;
use nalgebra::{Matrix3, Vector3};

/// Rounds of shrinking and solving; of expectation and maximisation; of the solution.
const ROUNDS: usize = 3;
const EXPECTATIONS: usize = 60;
const STEPS: usize = 60;

/// The length of a step that is the last, or its square in units of the motion's standard deviation; and the
/// farthest that the direction may come, degrees.
const STEP: f64 = 1e-9;
const NEGLIGIBLE: f64 = 1e-8;
const FARTHEST: f64 = 30.0;

/// The solution with the surfaces in its weights.
pub(crate) struct Shrunk {
    pub motion: Motion,
    pub surfaces: Vec<Vector3<f64>>,
}

/// Posterior means `mu + L (L + C)^-1 (lambda^ - mu)` under a normal distribution `N(mu, L)` fitted by
/// expectation and maximisation.
fn posterior_means(surfaces: &[(Vector3<f64>, Matrix3<f64>)]) -> Option<Vec<Vector3<f64>>> {
    let count = surfaces.len() as f64;
    // Begins with the precise ones: near the epipole a surface says nothing.
    let (mut weights, mut mean) = (Matrix3::zeros(), Vector3::zeros());
    for (surface, covariance) in surfaces {
        let weight = covariance.try_inverse()?;
        weights += weight;
        mean += weight * surface;
    }
    let mut mean = weights.try_inverse()? * mean;
    let mut spread = Matrix3::from_diagonal(&Vector3::repeat(mean.norm_squared().max(f64::MIN_POSITIVE)));
    let mut posterior: Vec<(Vector3<f64>, Matrix3<f64>)> = Vec::new();
    for _ in 0..EXPECTATIONS {
        posterior.clear();
        for (surface, covariance) in surfaces {
            let gain = spread * (spread + covariance).try_inverse()?;
            posterior.push((mean + gain * (surface - mean), spread - gain * spread));
        }
        mean = posterior.iter().map(|(m, _)| m).sum::<Vector3<f64>>() / count;
        let scatter = |(m, v): &(Vector3<f64>, Matrix3<f64>)| (m - mean) * (m - mean).transpose() + v;
        spread = posterior.iter().map(scatter).sum::<Matrix3<f64>>() / count;
        spread = 0.5 * (spread + spread.transpose());
    }
    Some(posterior.into_iter().map(|(m, _)| m).collect())
}

/// Solves `sum D(lambda~)^t e = 0` from `start`; `None` where that fails or leads far away.
pub(crate) fn shrunk(system: &System, start: &Motion) -> Option<Shrunk> {
    let mut motion = *start;
    let mut surfaces = Vec::new();
    for _ in 0..ROUNDS {
        let seen: Vec<_> = system
            .patches
            .iter()
            .map(|patch| {
                let seen = patch.seen(&motion);
                (seen.surface, seen.covariance)
            })
            .collect();
        surfaces = posterior_means(&seen)?;
        motion = solve(system, &motion, &surfaces)?;
        if motion.angle_to(start).to_degrees() > FARTHEST {
            return None;
        }
    }
    Some(Shrunk { motion, surfaces })
}

/// Scoring steps: the expected slope of the equation is that of its weights' own information.
///
/// The equation's slope for the noise at hand is another, most where the epipole lies among patches: steps
/// that grow went too far, and from there on they are half as long.
fn solve(system: &System, start: &Motion, surfaces: &[Vector3<f64>]) -> Option<Motion> {
    let (mut motion, mut share, mut before) = (*start, 1.0, f64::INFINITY);
    for _ in 0..STEPS {
        let tangent = tangents(&motion.u());
        let here = system.equations(&motion, &tangent, Some(surfaces));
        let step = here.h.cholesky()?.solve(&here.gradient);
        let length = here.gradient.dot(&step);
        if length > before {
            share *= 0.5;
        }
        before = length;
        motion = motion.stepped(&tangent, &(share * step));
        if !step.iter().all(|value| value.is_finite()) {
            return None;
        }
        if step.norm() < STEP || length < NEGLIGIBLE {
            return Some(motion);
        }
    }
    None
}
