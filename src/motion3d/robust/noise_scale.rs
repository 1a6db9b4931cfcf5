//! Estimates unknown noise from the residuals of the inliers.

use super::UNKNOWNS;
use crate::ablation::keeps;
use crate::motion3d::kernels::depths;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;

/// First guess of unknown noise, as a share of the median flow.
pub(crate) const FIRST_SHARE: f64 = 0.05;

/// Residuals that estimate noise, in units of it; their mean square relative to the variance, for a normal
/// distribution cut there.
const CUT: f64 = 2.5;
const CUT_VARIANCE: f64 = 0.911;

/// The share of the information about a variance that is left to them.
const CUT_INFORMATION: f64 = 0.69;

/// Most steps.
const STEPS: usize = 50;

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
