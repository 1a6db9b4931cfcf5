//! The estimating equation with surfaces drawn to their distribution over the patches, and whether its
//! covariance holds.
//!
//! With few patches neither is the theory linear nor are the surfaces in the weights known: the scene that
//! was found is measured again with new noise and solved again (the bootstrap, B. Efron 1979).

use super::system::PatchSystem;
use crate::math::{quantile, random::CounterRng, tangents};
use crate::motion3d::model::{motion::Motion, observations::SAMPLE, rows::Matrix5};
use crate::motion3d::solver::covariance::{PLAUSIBLE, inverse, plugged};
use crate::motion3d::solver::efficient::{FARTHEST, ROUNDS};
use crate::motion3d::solver::refine::StoppingCriteria;
use crate::parallel;
use nalgebra::{Matrix3, Vector3, Vector6};

/// Repetitions of few patches.
const REPETITIONS: u64 = 200;

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
    for _ in 0..StoppingCriteria::FULL.steps {
        posterior.clear();
        for (surface, covariance) in surfaces {
            let gain = spread * (spread + covariance).try_inverse()?;
            posterior.push((mean + gain * (surface - mean), spread - gain * spread));
        }
        mean = posterior.iter().map(|(m, _)| m).sum::<Vector3<f64>>() / count;
        let scatter = |(m, v): &(Vector3<f64>, Matrix3<f64>)| (m - mean) * (m - mean).transpose() + v;
        spread = posterior.iter().map(scatter).sum::<Matrix3<f64>>() / count;
        spread = spread.symmetric_part();
    }
    Some(posterior.into_iter().map(|(m, _)| m).collect())
}

/// Solves `sum D(lambda~)^t e = 0` from `start`; `None` where that fails or leads far away.
pub(crate) fn shrunk(system: &PatchSystem, start: &Motion) -> Option<Shrunk> {
    let mut found = Shrunk { motion: *start, surfaces: Vec::new() };
    for _ in 0..ROUNDS {
        let seen = system.all.iter().map(|patch| patch.seen(&found.motion));
        found.surfaces = posterior_means(&seen.map(|seen| (seen.surface, seen.covariance)).collect::<Vec<_>>())?;
        found.motion = solve(system, &found.motion, &found.surfaces)?;
        if found.motion.angle_to(start).to_degrees() > FARTHEST {
            return None;
        }
    }
    Some(found)
}

/// Scoring steps, with the expected slope of the equation. Where the epipole lies among patches the actual
/// slope is another: after a step that grows they are half as long.
fn solve(system: &PatchSystem, start: &Motion, surfaces: &[Vector3<f64>]) -> Option<Motion> {
    let (mut motion, mut share, mut before) = (*start, 1.0, f64::INFINITY);
    for _ in 0..StoppingCriteria::FULL.steps {
        let tangent = tangents(&motion.u());
        let here = system.equations(&motion, &tangent, Some(surfaces));
        let step = here.h.cholesky()?.solve(&here.gradient);
        // Squared, in standard deviations of the motion.
        let length = here.gradient.dot(&step);
        if length > before {
            share *= 0.5;
        }
        before = length;
        motion = motion.stepped(&tangent, &(share * step));
        if !step.iter().all(|value| value.is_finite()) {
            return None;
        }
        if length < 1e-8 {
            return Some(motion);
        }
    }
    None
}

/// What the covariance of a motion with these surfaces is to be multiplied with, at least 1, for its 95 %
/// ellipsoid to hold; `weighted`: solved with drawn surfaces in the weights.
pub(crate) fn covariance_factor(
    system: &PatchSystem,
    motion: &Motion,
    surfaces: &[Vector3<f64>],
    weighted: bool,
    rng: CounterRng,
) -> f64 {
    if system.all.len() >= SAMPLE {
        return 1.0;
    }
    let repeated = |i: u64| distance(&again(system, motion, surfaces, rng.stream(i)), motion, weighted);
    let mut distances: Vec<f64> = parallel::map(0..REPETITIONS, repeated);
    (quantile(&mut distances, 0.95).unwrap_or(0.0) / PLAUSIBLE).max(1.0)
}

/// The same patches with new noise.
fn again(system: &PatchSystem, motion: &Motion, surfaces: &[Vector3<f64>], rng: CounterRng) -> PatchSystem {
    let mut out = system.clone();
    for (k, (patch, surface)) in out.all.iter_mut().zip(surfaces).enumerate() {
        let noise = Vector6::from_fn(|i, _| rng.normal((6 * k + i) as u64));
        patch.f = patch.predicted(motion, surface) + noise;
    }
    out
}

/// The squared error of what is found, in units of its own covariance; infinite where nothing is.
fn distance(system: &PatchSystem, truth: &Motion, weighted: bool) -> f64 {
    let likeliest = system.refine(truth);
    let found = || -> Option<(Motion, Matrix5)> {
        if !weighted {
            let plugged = plugged(&likeliest.equations.h, &likeliest.equations.p)?;
            return Some((likeliest.motion, plugged.likelihood));
        }
        let Shrunk { motion, surfaces } = shrunk(system, &likeliest.motion)?;
        Some((motion, inverse(&system.equations(&motion, &tangents(&motion.u()), Some(&surfaces)).h)?))
    };
    let Some((found, covariance)) = found() else { return f64::INFINITY };
    let off = truth.offset(&found, &tangents(&found.u()));
    covariance.cholesky().map_or(f64::INFINITY, |factor| off.dot(&factor.solve(&off)))
}
