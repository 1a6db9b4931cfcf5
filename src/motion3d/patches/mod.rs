//! Motion from six numbers a patch, flow and Jacobian: three constraints each, where flow alone gives one.
//!
//! It pays for few, large patches seen through a long lens; noisy slants used as weights make maximum
//! likelihood worse than flow alone, so that they are shrunk.
//!
//! `derotation` takes the rotation out of displacements, `system` has the equations, `shrinkage` solves them
//! with shrunk slants, `bootstrap` tests the covariance of few patches. `status` and `report` follow.

mod bootstrap;
mod derotation;
mod report;
mod shrinkage;
mod status;
mod system;

use crate::error::{Error, Result};
use crate::math::by_chance;
use crate::math::random::CounterRng;
use crate::motion3d::bound::{MotionBound, check_truth, not_determined, too_few};
use crate::motion3d::diagnostics::rotation_only::RotationOnly;
use crate::motion3d::model::camera::{Intrinsics, to_plane};
use crate::motion3d::model::derotation::Derotation;
use crate::motion3d::model::input::{Noise, Placement, is_covariance, not_covariance};
use crate::motion3d::model::motion::{Motion, Projection};
use crate::motion3d::model::options::{Method, MotionOptions};
use crate::motion3d::model::result::{CommonEffect, Likelihood, MotionEstimate, Status, UNKNOWN, axes, nested};
use crate::motion3d::model::rows::tangents;
use crate::motion3d::model::whitening::floored_covariances;
use crate::motion3d::solver::covariance::{determined, inverse, plugged};
use crate::motion3d::solver::starts::{apart, evaluate, sample};
use bootstrap::wider;
use derotation::{beforehand, settle, turned_patch};
use nalgebra::{DMatrix, Matrix3, Vector3};
use report::{report_motion, turning_report};
use shrinkage::shrunk;
use status::{Evidence, judge};
use std::collections::HashSet;
use system::{Patch, System};

/// Patches with their affine flow, N of each.
#[derive(Debug, Clone, Copy)]
pub struct AffinePatches<'a> {
    /// Centres, px with a camera, else on the plane at distance 1.
    pub points: &'a [[f64; 2]],
    /// `(u, v, u_x, v_x, u_y, v_y)`: displacement in the same unit and its slopes, 1/frame.
    pub motion: &'a [[f64; 6]],
    /// Covariances of the six numbers, 36 values a patch, row by row.
    pub covariances: &'a [f64],
    /// The camera; `None`: everything is on the plane at distance 1.
    pub camera: Option<&'a Intrinsics>,
}

/// Least number of patches for a motion, for a nearly unique one, and for a distribution of surfaces.
const MIN_PATCHES: usize = 2;
const FEW: usize = 5;
const SMOOTHED: usize = 5;

/// Most patches that the search over directions looks at.
const SEARCHED: usize = 200;
const STARTS: usize = 5;
const APART: f64 = 12.0;

/// By how much a covariance may have to be inflated for it to describe the shape of the confidence region.
const NONLINEAR: f64 = 4.0;

impl AffinePatches<'_> {
    fn check(&self) -> Result<()> {
        let n = self.points.len();
        if self.motion.len() != n {
            return Err(Error::argument("flow", format!("{n} values, one for each point"), self.motion.len()));
        }
        if self.covariances.len() != 36 * n {
            let expected = format!("{n} matrices of 36 values");
            return Err(Error::argument("cov", expected, format!("{} values", self.covariances.len())));
        }
        for (k, given) in self.covariances.chunks_exact(36).enumerate() {
            if !is_covariance(&DMatrix::from_row_slice(6, 6, given)) {
                return Err(not_covariance(k, given));
            }
        }
        Ok(())
    }

    /// The usable patches, whitened; with a `turn`, as displacements with that rotation taken out of them.
    fn system(&self, placement: Placement, turn: Option<&Derotation>) -> System {
        let (mut patches, mut source) = (Vec::new(), Vec::new());
        for k in 0..self.points.len() {
            let patch = match turn {
                Some(turn) => turned_patch(self, k, turn),
                None => self.patch(k, placement),
            };
            if let Some(patch) = patch {
                patches.push(patch);
                source.push(k as u32);
            }
        }
        System { patches, source }
    }

    fn patch(&self, k: usize, placement: Placement) -> Option<Patch> {
        let mut m = nalgebra::Vector6::from(self.motion[k]);
        let mut at = self.points[k];
        if placement == Placement::Midpoint {
            at = [at[0] + 0.5 * m[0], at[1] + 0.5 * m[1]];
            let slopes = nalgebra::Matrix2::new(m[2], m[4], m[3], m[5]);
            // M_mid = M (I + M / 2)^-1: slopes by the place half way.
            let slopes = slopes * (nalgebra::Matrix2::identity() + 0.5 * slopes).try_inverse()?;
            m.fixed_rows_mut::<4>(2).copy_from_slice(slopes.as_slice());
        }
        let mut covariance = nalgebra::Matrix6::from_row_slice(&self.covariances[36 * k..36 * (k + 1)]);
        if let Some(camera) = self.camera {
            let map = camera.affine_scale();
            at = camera.to_plane(at);
            m = map * m;
            covariance = map * covariance * map.transpose();
        }
        Patch::new(at, &m, &covariance, None)
    }
}

/// The rigid motion that explains the affine flow of patches.
///
/// As [`estimate_motion`](crate::motion3d::estimate_motion), with six numbers a patch: maximum likelihood;
/// then, from 5 patches on, inverse depths and their slopes in the weights drawn to their distribution over
/// the patches.
/// Patches should be fits over windows of 30 px and more that do not overlap: numbers that share noise must
/// come with covariances that say so. Other minima and opposite directions that no patch behind the camera
/// excludes are reported as for points.
///
/// # Errors
/// [`Error::Argument`] naming what has the wrong length: `flow`, `cov`; `robust`, `weight_inv_depth`,
/// `rotation_prior`, `points_per_independent_sample` and `correlation_length`, which this form does not have.
pub fn estimate_patch_motion(patches: &AffinePatches<'_>, options: &MotionOptions) -> Result<MotionEstimate> {
    patches.check()?;
    let refuse = |name: &'static str| {
        Err(Error::argument(name, "its default, as six numbers are given a patch", "another value"))
    };
    match options {
        MotionOptions { robust: true, .. } => return refuse("robust"),
        MotionOptions { weight_depths: Some(_), .. } => return refuse("weight_inv_depth"),
        MotionOptions { rotation_prior: Some(_), .. } => return refuse("rotation_prior"),
        MotionOptions { points_per_independent_sample: Some(points), .. } if *points != 1.0 => {
            return refuse("points_per_independent_sample");
        }
        MotionOptions { correlation_length: Some(length), .. } if *length != 0.0 => {
            return refuse("correlation_length");
        }
        _ => {}
    }
    options.check_common(Projection::Plane)?;
    let covariances = floored_covariances(patches.covariances, 6);
    let patches = AffinePatches { covariances: &covariances, ..*patches };
    Ok(options.threads.check()?.install(|| estimate(&patches, options)))
}

fn estimate(patches: &AffinePatches<'_>, options: &MotionOptions) -> MotionEstimate {
    let points = patches.points;
    let mut system = beforehand(patches, options);
    let (used, n) = (system.patches.len(), points.len());
    if used < MIN_PATCHES {
        return MotionEstimate::nothing(n, Status::TooFewPoints, 1.0);
    }
    if let Some(rotation) = explained_by_rotation(&system) {
        return turning_report(&system, n, &rotation, &options.systematic_errors(), &to_plane(patches.camera));
    }
    let rng = CounterRng::new(options.random_state);
    let mut minima = match options.initial {
        Some(initial) => vec![system.refine(&Motion::new(initial.translation, initial.rotation))],
        None => minima(&system, rng),
    };
    settle(patches, options, &mut system, &mut minima);
    let system = &system;
    let Some(&best) = minima.first() else {
        return MotionEstimate::nothing(n, Status::TooFewPoints, 1.0);
    };
    let tangent = tangents(&best.u());
    let at_best = system.equations(&best, &tangent, None);
    let plugged = plugged(&at_best.h, &at_best.p);
    let wanted = options.method == Method::Efficient || (options.method == Method::Auto && used >= SMOOTHED);
    let improved = if wanted || plugged.is_none() { shrunk(system, &best) } else { None };
    let mut out = MotionEstimate::nothing(n, Status::Ok, 1.0);
    out.fell_back = wanted && improved.is_none();
    let (mut motion, mut covariance) = (best, plugged.map(|plugged| plugged.likelihood));
    let mut surfaces = None;
    if let Some(found) = improved {
        let info = system.equations(&found.motion, &tangents(&found.motion.u()), Some(&found.surfaces)).h;
        if wanted {
            motion = found.motion;
            covariance = inverse(&info);
            surfaces = Some(found.surfaces);
        } else {
            covariance = inverse(&system.equations(&best, &tangent, Some(&found.surfaces)).h);
        }
    }
    out.efficient = surfaces.is_some();
    let depths: Vec<Vector3<f64>> = match &surfaces {
        Some(surfaces) => surfaces.clone(),
        None => system.patches.iter().map(|patch| patch.seen(&motion).surface).collect(),
    };
    let wider = if plugged.is_some() { wider(system, &motion, &depths, out.efficient, rng.stream(2)) } else { 1.0 };
    let displaced = (&system.moved(&motion, &depths), &to_plane(patches.camera));
    let common = |covariance| options.systematic_errors().on(&covariance, &motion, None, displaced);
    out.common = covariance.map_or_else(CommonEffect::default, common);
    covariance = covariance.map(|covariance| covariance * wider + out.common.added());
    let low = plugged.is_none() || wider > NONLINEAR;
    let planar = report_motion(&mut out, system, &motion, covariance, surfaces.as_deref());
    out.likelihood = Likelihood {
        motion: best,
        covariance: plugged.map_or(UNKNOWN, |plugged| nested(&plugged.likelihood)),
        tangent: axes(&tangent),
        cost: at_best.cost,
    };
    let evidence = Evidence { minima: &minima, few: places(system, points) < FEW, planar, low };
    judge(&mut out, system, &evidence, rng.stream(1));
    out
}

/// Patches at different places: those at one determine no more surfaces, and of no more constraints, than one
/// of less noise.
fn places(system: &System, points: &[[f64; 2]]) -> usize {
    let place = |&k: &u32| points[k as usize].map(f64::to_bits);
    system.source.iter().map(place).collect::<HashSet<_>>().len()
}

/// The minima that are reached from the best directions of the half sphere, both signs each, the cheapest
/// first.
fn minima(system: &System, rng: CounterRng) -> Vec<Motion> {
    let few = system.subset(&sample(system.patches.len(), SEARCHED, rng));
    let found = evaluate(|u| few.best_rotation(u).map(|(w, cost)| (Motion::of(u, &w), cost)));
    let refined = apart(found, APART, STARTS).into_iter().map(|(start, _)| system.refine(&start));
    cheapest(system, refined.flat_map(|motion| [motion, motion.reversed()]))
}

/// Sorted by what residuals and patches behind the camera cost.
fn cheapest(system: &System, motions: impl Iterator<Item = Motion>) -> Vec<Motion> {
    let cost = |motion: Motion| {
        let here = system.equations(&motion, &tangents(&motion.u()), None);
        (motion, here.cost + here.behind)
    };
    let mut minima: Vec<(Motion, f64)> = motions.map(cost).collect();
    minima.retain(|(_, cost)| cost.is_finite());
    minima.sort_by(|a, b| a.1.total_cmp(&b.1));
    minima.into_iter().map(|(motion, _)| motion).collect()
}

/// The rotation alone, where chance explains what it leaves.
fn explained_by_rotation(system: &System) -> Option<RotationOnly> {
    let found = least_squares(system)?;
    by_chance(found.chi2, (6 * system.patches.len() - 3) as f64).then_some(found)
}

fn least_squares(system: &System) -> Option<RotationOnly> {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for patch in &system.patches {
        normal += patch.r.transpose() * patch.r;
        right += patch.r.transpose() * patch.f;
    }
    let factor = normal.cholesky()?;
    let rotation = factor.solve(&right);
    let chi2: f64 = system.patches.iter().map(|patch| (patch.f - patch.r * rotation).norm_squared()).sum();
    Some(RotationOnly { rotation, covariance: factor.inverse(), chi2 })
}

/// As [`motion_bound`](crate::motion3d::motion_bound), for six numbers a patch whose true `(nu, nu_x, nu_y)`
/// are given;
/// their flow is not looked at.
///
/// # Errors
/// As [`motion_bound`](crate::motion3d::motion_bound).
pub fn patch_motion_bound(patches: &AffinePatches<'_>, motion: &Motion, surfaces: &[[f64; 3]]) -> Result<MotionBound> {
    patches.check()?;
    check_truth(&Noise::StandardDeviation(1.0), motion)?;
    if surfaces.len() != patches.points.len() {
        let expected = format!("{} surfaces, one for each point", patches.points.len());
        return Err(Error::argument("inv_depth", expected, surfaces.len()));
    }
    let system = patches.system(Placement::Start, None);
    if system.patches.len() < MIN_PATCHES {
        let finite = |at: &&[f64; 2]| at.iter().all(|value| value.is_finite());
        return Err(too_few(MIN_PATCHES, patches.points.iter().filter(finite).count()));
    }
    let known: Vec<u32> = (0..system.patches.len() as u32)
        .filter(|&k| surfaces[system.source[k as usize] as usize].iter().all(|value| value.is_finite()))
        .collect();
    if known.len() < MIN_PATCHES {
        return Err(Error::argument("inv_depth", "finite surfaces of two patches at least", known.len()));
    }
    let system = system.subset(&known);
    let surfaces: Vec<Vector3<f64>> = system.source.iter().map(|&k| surfaces[k as usize].into()).collect();
    let tangent = tangents(&motion.u());
    let truth = system.equations(motion, &tangent, Some(&surfaces));
    let bound = determined(&truth.h).ok_or_else(not_determined)?;
    let likelihood = bound + bound * truth.p * bound;
    let ideal = bound + bound * system.weighted_noise(motion, &tangent, &surfaces, &bound) * bound;
    Ok(MotionBound::of(&tangent, &bound, &likelihood, &ideal))
}
