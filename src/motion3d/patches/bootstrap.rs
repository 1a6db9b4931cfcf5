//! Whether the covariance of few patches holds: the experiment again, with noise by chance.
//!
//! The theory is linear and takes the surfaces in the weights for known. With few patches neither is so, and
//! the errors have longer tails than a covariance from one linear step has. The scene that was found is
//! measured again with new noise, and solved again: the errors in units of each repetition's own covariance
//! are what the first one's are to be judged by (B. Efron 1979: the bootstrap).

use super::shrinkage::shrunk;
use super::system::System;
use crate::math::quantile;
use crate::math::random::CounterRng;
use crate::motion3d::diagnostics::confidence_region::PLAUSIBLE;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::rows::{Matrix5, Vector5, tangents};
use crate::motion3d::solver::covariance::{inverse, plugged};
use nalgebra::{Vector3, Vector6};
use rayon::prelude::*;

/// Patches from which on the linear theory does.
const MANY: usize = 30;

/// Repetitions, and the share of them that a region of that probability is to hold.
const REPETITIONS: u64 = 200;
const SHARE: f64 = 0.95;

/// What the covariance of a motion with these surfaces is to be multiplied with, at least 1, for its 95 %
/// ellipsoid to hold; `weighted`: solved with drawn surfaces in the weights.
pub(crate) fn wider(
    system: &System,
    motion: &Motion,
    surfaces: &[Vector3<f64>],
    weighted: bool,
    rng: CounterRng,
) -> f64 {
    if system.patches.len() >= MANY {
        return 1.0;
    }
    let repeated = |i: u64| distance(&again(system, motion, surfaces, rng.stream(i)), motion, weighted);
    let mut distances: Vec<f64> = (0..REPETITIONS).into_par_iter().map(repeated).collect();
    (quantile(&mut distances, SHARE).unwrap_or(0.0) / PLAUSIBLE).max(1.0)
}

/// The same patches with new noise.
fn again(system: &System, motion: &Motion, surfaces: &[Vector3<f64>], rng: CounterRng) -> System {
    let mut out = system.clone();
    for (k, (patch, surface)) in out.patches.iter_mut().zip(surfaces).enumerate() {
        let noise = Vector6::from_fn(|i, _| rng.normal((6 * k + i) as u64));
        patch.f = patch.predicted(motion, surface) + noise;
    }
    out
}

/// The squared error of what is found, in units of its own covariance; infinite where nothing is.
fn distance(system: &System, truth: &Motion, weighted: bool) -> f64 {
    let found = || -> Option<(Motion, Matrix5)> {
        let likeliest = system.refine(truth);
        if weighted {
            let found = shrunk(system, &likeliest)?;
            let tangent = tangents(&found.motion.u());
            let information = system.equations(&found.motion, &tangent, Some(&found.surfaces)).h;
            return Some((found.motion, inverse(&information)?));
        }
        let here = system.equations(&likeliest, &tangents(&likeliest.u()), None);
        Some((likeliest, plugged(&here.h, &here.p)?.likelihood))
    };
    let Some((found, covariance)) = found() else { return f64::INFINITY };
    let along = tangents(&found.u()) * truth.u();
    let turn = truth.w() - found.w();
    let off = Vector5::from_column_slice(&[along.x, along.y, turn.x, turn.y, turn.z]);
    covariance.cholesky().map_or(f64::INFINITY, |factor| off.dot(&factor.solve(&off)))
}
