//! Estimates unknown noise from the residuals of the inliers.
//!
//! The noise is a fixed point of its own estimate, and there may be several: with a moving object, one at
//! the noise and one at which both motions pass for one in larger noise. Residuals of an object have the
//! same sign as their neighbours', those of noise do not.

use super::residual_autocorrelation::is_autocorrelated;
use super::{Consensus, UNKNOWNS, in_noise};
use crate::ablation::keeps;
use crate::math::random::CounterRng;
use crate::motion3d::kernels::depths;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::{Observations, Scaled};
use crate::motion3d::model::whitening::Whitening;

/// First guesses, in shares of the median flow: the next one where residuals go together.
const FIRST_SHARES: [f64; 3] = [0.05, 0.0125, 0.003];

/// Residuals that estimate noise, in units of it; their mean square relative to the variance, for a normal
/// distribution cut there.
const CUT: f64 = 2.5;
const CUT_VARIANCE: f64 = 0.911;

/// The share of the information about a variance that is left to them.
const CUT_INFORMATION: f64 = 0.69;

/// Most steps.
const STEPS: usize = 50;

/// The share of the inliers in larger noise that those in smaller noise must be.
const MIN_INLIER_SHARE: f64 = 0.5;

/// Returns the motion with the most inliers in the noise of these inliers, which becomes the unit of the
/// points.
pub(crate) fn consensus(whitening: &Whitening<'_>, scaled: &mut Scaled, rng: CounterRng) -> Option<Consensus> {
    let flow = scaled.observations.median_flow() * scaled.noise_std;
    let mut larger: Option<(Consensus, f64)> = None;
    for share in FIRST_SHARES {
        scaled.take(share * flow / scaled.noise_std);
        let Some(found) = in_noise(whitening, scaled, true, rng) else { break };
        let enough = larger
            .as_ref()
            .is_none_or(|(one, _)| found.inliers.len() as f64 > MIN_INLIER_SHARE * one.inliers.len() as f64);
        if !keeps("motion3d.noise_restarts")
            || enough && !is_autocorrelated(&scaled.observations, &found.motion, &found.inliers)
        {
            return Some(found);
        }
        if larger.is_none() {
            larger = Some((found, scaled.noise_std));
        }
    }
    // A moving object looks the same as correlated errors of the flow.
    let (found, noise_std) = larger?;
    scaled.take(noise_std / scaled.noise_std);
    Some(found)
}

/// Standard deviations by which the noise of the inliers must exceed the given one.
const LARGER: f64 = 4.0;

/// Variance of the noise of the inliers relative to the given one, if chance does not explain the
/// difference; 1 if errors are not independent.
pub(crate) fn larger(observations: &Observations, motion: &Motion) -> f64 {
    if !observations.independent || !keeps("motion3d.larger_noise") {
        return 1.0;
    }
    let variance = noise(&depths(observations, motion).e[..observations.n]).powi(2);
    let chance = LARGER * (2.0 / (CUT_INFORMATION * observations.n as f64)).sqrt();
    if variance > 1.0 + chance { variance } else { 1.0 }
}

/// The fixed point of "the root mean square of the residuals below 2.5 standard deviations, divided by that
/// of a cut normal distribution"; the five unknowns take their share away.
pub(crate) fn noise(residuals: &[f64]) -> f64 {
    let mut noise_std = 1.0;
    for _ in 0..STEPS {
        let (mut sum, mut count) = (0.0, 0usize);
        for e in residuals.iter().filter(|e| e.abs() < CUT * noise_std) {
            sum += e * e;
            count += 1;
        }
        if count <= UNKNOWNS || sum <= 0.0 {
            break;
        }
        let next = (sum / (CUT_VARIANCE * (count - UNKNOWNS) as f64)).sqrt();
        let settled = (next - noise_std).abs() < 1e-6 * noise_std;
        noise_std = next;
        if settled {
            break;
        }
    }
    noise_std
}
