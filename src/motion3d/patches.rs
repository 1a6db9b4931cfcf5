//! Motion from six numbers a patch, flow and Jacobian: three constraints each, where flow alone gives one.
//!
//! It pays for few, large patches seen through a long lens; noisy slants used as weights make maximum likelihood worse than flow alone, so that they are shrunk.

mod shrink;
mod system;

use super::bound::{MotionBound, check_truth, not_determined};
use super::camera::Intrinsics;
use super::covariance::{Matrix5, direction_deviation, inverse, plugged_in};
use super::grid::{apart, evaluate, sample};
use super::motion::{Motion, tangents};
use super::options::{Method, MotionOptions, Noise, Placement};
use super::result::{Alternative, Likelihood, MotionEstimate, Status, UNKNOWN, nested};
use super::special::by_chance;
use crate::error::{Error, Result};
use crate::math::random::CounterRng;
use nalgebra::{Matrix2x3, Matrix3, Vector2, Vector3};
use shrink::shrunk;
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
const LEAST: usize = 2;
const FEW: usize = 5;
const SMOOTHED: usize = 5;

/// Most patches that the search over directions looks at.
const SEARCHED: usize = 200;
const STARTS: usize = 5;
const APART: f64 = 12.0;

/// Standard deviation of the direction, degrees, beyond which it is not known.
const WIDE: f64 = 20.0;

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
        Ok(())
    }

    /// The usable patches, whitened.
    fn system(&self, placement: Placement) -> System {
        let (mut patches, mut source) = (Vec::new(), Vec::new());
        for k in 0..self.points.len() {
            if let Some(patch) = self.patch(k, placement) {
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
        Patch::new(at, &m, &covariance)
    }
}

/// The rigid motion that explains the affine flow of patches.
///
/// As [`estimate_motion`](super::estimate_motion), with six numbers a patch: maximum likelihood; then, from 5 patches on, inverse depths and their slopes in the weights drawn to their distribution over the patches. Patches should
/// be fits over windows of 30 px and more that do not overlap: numbers that share noise must come with covariances that say so.
///
/// # Errors
/// [`Error::Argument`] naming what has the wrong length: `flow`, `cov`; `robust`, `weight_inv_depth` and `rotation_prior`, which this form does not have.
pub fn estimate_patch_motion(patches: &AffinePatches<'_>, options: &MotionOptions) -> Result<MotionEstimate> {
    patches.check()?;
    let refuse = |name: &'static str| {
        Err(Error::argument(name, "its default, as six numbers are given a patch", "another value"))
    };
    match options {
        MotionOptions { robust: true, .. } => return refuse("robust"),
        MotionOptions { weight_depths: Some(_), .. } => return refuse("weight_inv_depth"),
        MotionOptions { rotation_prior: Some(_), .. } => return refuse("rotation_prior"),
        _ => {}
    }
    let system = patches.system(options.placement);
    Ok(options.threads.check()?.install(|| estimate(&system, patches.points.len(), options)))
}

fn estimate(system: &System, n: usize, options: &MotionOptions) -> MotionEstimate {
    let used = system.patches.len();
    if used < LEAST {
        return MotionEstimate::nothing(n, Status::TooFewPoints, 1.0);
    }
    if let Some((rotation, covariance)) = turning(system) {
        return turning_report(system, n, rotation, &covariance);
    }
    let near = options.initial.map(|initial| system.refine(&Motion::new(initial.translation, initial.rotation)));
    let Some(best) = near.or_else(|| minimum(system, CounterRng::new(options.seed))) else {
        return MotionEstimate::nothing(n, Status::TooFewPoints, 1.0);
    };
    let tangent = tangents(&best.u());
    let at_best = system.equations(&best, &tangent, None);
    let plugged = plugged_in(&at_best.h, &at_best.p);
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
    let low = plugged.is_none();
    let planar = tell(&mut out, system, &motion, covariance, surfaces.as_deref());
    out.likelihood = Likelihood {
        motion: best,
        covariance: plugged.map_or(UNKNOWN, |plugged| nested(&plugged.likelihood)),
        tangent: axes(&tangent),
        cost: at_best.cost,
    };
    out.status = if used < FEW {
        Status::FewPoints
    } else if planar {
        Status::Ambiguous
    } else if out.direction_std.is_nan() || out.direction_std > WIDE {
        Status::IllConditioned
    } else if low {
        Status::LowSnr
    } else {
        Status::Ok
    };
    out
}

fn axes(tangent: &Matrix2x3<f64>) -> [[f64; 3]; 2] {
    std::array::from_fn(|i| std::array::from_fn(|j| tangent[(i, j)]))
}

/// Fills in what is told about a motion; whether the patches are one plane that has another motion too.
fn tell(
    out: &mut MotionEstimate,
    system: &System,
    motion: &Motion,
    covariance: Option<Matrix5>,
    surfaces: Option<&[Vector3<f64>]>,
) -> bool {
    let tangent = tangents(&motion.u());
    out.motion = *motion;
    out.tangent = axes(&tangent);
    if let Some(covariance) = covariance {
        out.covariance = nested(&covariance);
        out.direction_std = direction_deviation(&covariance);
        out.rotation_std = std::array::from_fn(|i| covariance[(2 + i, 2 + i)].sqrt());
    }
    let here = system.equations(motion, &tangent, None);
    if let Some(plugged) = plugged_in(&here.h, &here.p) {
        out.bound = nested(&plugged.bound);
    }
    out.surfaces = vec![[f64::NAN; 3]; out.inliers.len()];
    for (k, (patch, &source)) in system.patches.iter().zip(&system.source).enumerate() {
        let (source, seen) = (source as usize, patch.seen(motion));
        let surface = surfaces.map_or(seen.surface, |surfaces| surfaces[k]);
        out.inverse_depth[source] = seen.surface[0];
        out.inverse_depth_std[source] = seen.covariance[(0, 0)].sqrt();
        out.inverse_depth_smooth[source] = surface[0];
        out.surfaces[source] = surface.into();
        out.residuals[source] = seen.cost.sqrt();
        out.inliers[source] = true;
        let rate = surface[0] * motion.translation[2];
        out.time_to_contact[source] = if rate == 0.0 { f64::INFINITY } else { -1.0 / rate };
        let slopes = Vector2::new(surface[0] * tangent[(0, 2)], surface[0] * tangent[(1, 2)]);
        let of_direction =
            covariance.map_or(f64::NAN, |c| (slopes.transpose() * c.fixed_view::<2, 2>(0, 0) * slopes)[0]);
        let variance = motion.translation[2].powi(2) * seen.covariance[(0, 0)] + of_direction;
        out.time_to_contact_std[source] = if rate == 0.0 { f64::INFINITY } else { variance.sqrt() / (rate * rate) };
    }
    let distinct = (3.0 * out.direction_std).to_radians().max(1e-6);
    match system.twin(motion) {
        Some(twin) if twin.angle_to(motion).min(twin.reversed().angle_to(motion)) > distinct => {
            out.alternatives.push(Alternative { motion: twin, excess: 0.0 });
            true
        }
        _ => false,
    }
}

/// The best motion of the whole half sphere, with the sign that has fewer patches behind the camera.
fn minimum(system: &System, rng: CounterRng) -> Option<Motion> {
    let few = system.subset(&sample(system.patches.len(), SEARCHED, rng));
    let found = evaluate(|u| few.best_rotation(u).map(|(w, cost)| (Motion::of(u, &w), cost)));
    let starts = apart(found, APART, STARTS);
    let refined =
        starts.into_iter().map(|(start, _)| system.refine(&start)).flat_map(|motion| [motion, motion.reversed()]);
    refined
        .map(|motion| {
            let here = system.equations(&motion, &tangents(&motion.u()), None);
            (motion, here.cost + here.behind)
        })
        .filter(|(_, cost)| cost.is_finite())
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(motion, _)| motion)
}

/// The rotation alone, where chance explains what it leaves.
fn turning(system: &System) -> Option<(Vector3<f64>, Matrix3<f64>)> {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for patch in &system.patches {
        normal += patch.r.transpose() * patch.r;
        right += patch.r.transpose() * patch.f;
    }
    let factor = normal.cholesky()?;
    let w = factor.solve(&right);
    let chi2: f64 = system.patches.iter().map(|patch| (patch.f - patch.r * w).norm_squared()).sum();
    by_chance(chi2, (6 * system.patches.len() - 3) as f64).then(|| (w, factor.inverse()))
}

fn turning_report(system: &System, n: usize, rotation: Vector3<f64>, covariance: &Matrix3<f64>) -> MotionEstimate {
    let mut out = MotionEstimate::nothing(n, Status::RotationOnly, 1.0);
    out.motion.rotation = rotation.into();
    out.likelihood.motion = out.motion;
    out.surfaces = vec![[f64::NAN; 3]; n];
    for i in 0..3 {
        for j in 0..3 {
            out.covariance[2 + i][2 + j] = covariance[(i, j)];
        }
        out.rotation_std[i] = covariance[(i, i)].sqrt();
    }
    out.bound = out.covariance;
    for (patch, &source) in system.patches.iter().zip(&system.source) {
        let source = source as usize;
        out.inverse_depth[source] = 0.0;
        out.inverse_depth_smooth[source] = 0.0;
        out.surfaces[source] = [0.0; 3];
        out.inverse_depth_std[source] = f64::INFINITY;
        out.time_to_contact[source] = f64::INFINITY;
        out.time_to_contact_std[source] = f64::INFINITY;
        out.residuals[source] = (patch.f - patch.r * rotation).norm();
        out.inliers[source] = true;
    }
    out
}

/// As [`motion_bound`](super::motion_bound), for six numbers a patch whose true `(nu, nu_x, nu_y)` are given; their flow is not looked at.
///
/// # Errors
/// As [`motion_bound`](super::motion_bound).
pub fn patch_motion_bound(patches: &AffinePatches<'_>, motion: &Motion, surfaces: &[[f64; 3]]) -> Result<MotionBound> {
    patches.check()?;
    check_truth(&Noise::Sigma(1.0), motion)?;
    if surfaces.len() != patches.points.len() {
        let expected = format!("{} surfaces, one for each point", patches.points.len());
        return Err(Error::argument("inv_depth", expected, surfaces.len()));
    }
    let system = patches.system(Placement::Start);
    let known: Vec<u32> = (0..system.patches.len() as u32)
        .filter(|&k| surfaces[system.source[k as usize] as usize].iter().all(|value| value.is_finite()))
        .collect();
    let system = system.subset(&known);
    let surfaces: Vec<Vector3<f64>> = system.source.iter().map(|&k| surfaces[k as usize].into()).collect();
    let tangent = tangents(&motion.u());
    let truth = system.equations(motion, &tangent, Some(&surfaces));
    let bound = inverse(&truth.h).ok_or_else(not_determined)?;
    let likelihood = bound + bound * truth.p * bound;
    let ideal = bound + bound * system.weighted_noise(motion, &tangent, &surfaces, &bound) * bound;
    Ok(MotionBound::of(&tangent, &bound, &likelihood, &ideal))
}
