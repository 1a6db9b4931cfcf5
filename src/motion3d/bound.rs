//! Experiment design: what a layout of points, a field of view and a noise allow.

use super::model::input::{Flow, Noise, Placement, refuse_if};
use super::model::motion::Motion;
use super::model::observations::UNKNOWNS;
use super::model::rows::nested;
use super::model::whitening::Whitening;
use super::patches::system::System;
use super::patches::{AffinePatches, MIN_PATCHES};
use super::solver::covariance::{determined, direction_deviation};
use crate::error::{Error, Result, numbers};
use crate::math::tangents;
use crate::parallel::Threads;
use nalgebra::SVector;

/// Covariances of `(psi, w)` that theory predicts, rad and rad/frame, in the axes `tangent`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionBound {
    /// The Cramér-Rao bound `sigma^2 M^-1` (8), (9).
    pub bound: [[f64; 5]; 5],
    /// Maximum likelihood `sigma^2 M^-1 + sigma^4 M^-1 P M^-1` (17), (24).
    pub likelihood: [[f64; 5]; 5],
    /// Ideal weights `sigma^2 M^-1 + sigma^4 M^-1 {sum c_kk P_k} M^-1` (25).
    pub ideal: [[f64; 5]; 5],
    /// Standard deviations of the direction, `sqrt(tr psi)`, degrees: of the bound, of maximum likelihood, of
    /// ideal weights.
    pub direction_std: [f64; 3],
    /// Axes of `psi`: two unit vectors perpendicular to `u`.
    pub tangent: [[f64; 3]; 2],
}

/// The covariances that maximum likelihood and ideal weights have, and the bound, for points whose true
/// inverse depths are given.
///
/// `points`: the places where flow is measured (their flow is not looked at); `inverse_depth`: `nu` (N) in
/// units of `|u|`. Points that are not finite are left out. (17) holds while it predicts less than about 5
/// degrees and the epipole is outside the points.
///
/// # Errors
/// [`Error::Argument`] for lengths that differ, fewer than 5 finite points, covariances or depths, noise that
/// is not given, a direction of length 0; [`Error::NotObservable`] when the points do not determine the
/// motion.
pub fn motion_bound(
    points: &Flow<'_>,
    noise: &Noise<'_>,
    motion: &Motion,
    inverse_depth: &[f64],
) -> Result<MotionBound> {
    points.check(noise)?;
    let is_unknown = matches!(noise, Noise::Unknown);
    refuse_if(is_unknown, "noise_std", "the noise of the flow, as noise_std or cov", "none")?;
    let observations = Threads::default().install(|| Whitening::new(points, noise, Placement::Start).whitened());
    let all = (0..observations.n).map(|k| observations.row(k).measurement()).collect();
    let depths: Vec<[f64; 1]> = inverse_depth.iter().map(|&nu| [nu]).collect();
    let finite = (0..points.len()).filter(|&k| points.place(k).iter().all(|value| value.is_finite())).count();
    of_known_depths(&System { all, source: observations.source }, motion, &depths, (points.len(), finite, UNKNOWNS))
}

/// As [`motion_bound`], for six numbers a patch whose true `(nu, nu_x, nu_y)` are given; their flow is not
/// looked at.
///
/// # Errors
/// As [`motion_bound`].
pub fn patch_motion_bound(patches: &AffinePatches<'_>, motion: &Motion, surfaces: &[[f64; 3]]) -> Result<MotionBound> {
    patches.check()?;
    let finite = patches.points.iter().filter(|at| at.iter().all(|value| value.is_finite())).count();
    of_known_depths(&patches.system(None), motion, surfaces, (patches.points.len(), finite, MIN_PATCHES))
}

/// For the usable of all `given` places, of which so many are finite and at least so many needed.
fn of_known_depths<const N: usize, const L: usize>(
    system: &System<N, L>,
    motion: &Motion,
    surfaces: &[[f64; L]],
    (given, finite, least): (usize, usize, usize),
) -> Result<MotionBound> {
    check_motion(&motion.translation, &motion.rotation)?;
    let (name, expected) = ("inv_depth", format!("{given} values, one for each point"));
    refuse_if(surfaces.len() != given, name, expected, surfaces.len())?;
    refuse_if(finite < least, "points", format!("at least {least} points that are finite"), finite)?;
    // The others lack a finite covariance.
    let expected = format!("finite covariances of at least {least} points");
    refuse_if(system.source.len() < least, "cov", expected, "fewer")?;
    let is_known = |&k: &u32| surfaces[system.source[k as usize] as usize].iter().all(|value| value.is_finite());
    let known: Vec<u32> = (0..system.source.len() as u32).filter(is_known).collect();
    refuse_if(known.len() < least, name, format!("finite values of at least {least} points"), known.len())?;
    let system = system.subset(&known);
    let surfaces: Vec<SVector<f64, L>> = system.source.iter().map(|&k| surfaces[k as usize].into()).collect();
    let tangent = tangents(&motion.u());
    let truth = system.equations(motion, &tangent, Some(&surfaces));
    let bound = determined(&truth.h).ok_or_else(|| {
        Error::NotObservable("these points do not determine the motion; more of them, or others, would".into())
    })?;
    let ideal = bound + bound * system.weighted_noise(motion, &tangent, &surfaces, &bound) * bound;
    let likelihood = bound + bound * truth.p * bound;
    Ok(MotionBound {
        bound: nested(&bound),
        likelihood: nested(&likelihood),
        ideal: nested(&ideal),
        direction_std: [bound, likelihood, ideal].map(|covariance| direction_deviation(&covariance)),
        tangent: nested(&tangent),
    })
}

/// Refuses a motion that is not finite or has no direction.
///
/// # Errors
/// [`Error::Argument`] naming `translation` or `rotation`.
pub fn check_motion(translation: &[f64; 3], rotation: &[f64; 3]) -> Result<()> {
    let is_finite = |values: &[f64; 3]| values.iter().all(|value| value.is_finite());
    let is_direction = is_finite(translation) && *translation != [0.0; 3];
    refuse_if(!is_direction, "translation", "a finite vector with a direction", numbers(translation))?;
    refuse_if(!is_finite(rotation), "rotation", "a finite vector", numbers(rotation))
}
