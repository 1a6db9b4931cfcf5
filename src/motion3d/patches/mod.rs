//! Motion from six numbers a patch, flow and Jacobian: three constraints each, where flow alone gives one.
//!
//! It pays for few, large patches seen through a long lens; noisy slants used as weights make maximum
//! likelihood worse than flow alone, so that they are shrunk.
//!
//! `system` has the equations, `shrinkage` solves them with shrunk slants and tests the covariance of few
//! patches.

mod shrinkage;
pub(crate) mod system;

use crate::error::Result;
use crate::math::{by_chance, random::CounterRng, tangents};
use crate::motion3d::diagnostics::contact::Rates;
use crate::motion3d::diagnostics::report::{likelihood, report_rotation, set_motion};
use crate::motion3d::diagnostics::status::{SURE, WIDE, different};
use crate::motion3d::model::input::{
    Placement, affine_map, check_covariances, check_lengths, check_on_plane, is_positive, refuse_if, to_plane,
};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::UNKNOWNS;
use crate::motion3d::model::options::{Method, MotionOptions};
use crate::motion3d::model::result::{Alternative, MotionEstimate, Status};
use crate::motion3d::model::rows::Derotation;
use crate::motion3d::model::whitening::floored;
use crate::motion3d::solver::covariance::{inverse, plugged};
use crate::motion3d::solver::finite_rotation::{ROUNDING, ROUNDS};
use crate::motion3d::solver::likelihood::{DISTINCT, SAME};
use crate::motion3d::solver::refine::Minimum;
use crate::motion3d::solver::starts::{APART, STARTS, apart, evaluate};
use crate::types::Intrinsics;
use nalgebra::{Matrix2, Matrix6, Vector3, Vector6};
use shrinkage::{covariance_factor, shrunk};
use std::collections::HashSet;
use system::{Patch, PatchSystem, System};

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

/// Least number of patches for a motion; for a nearly unique one and for a distribution of surfaces it is
/// that of a motion's unknowns.
pub(crate) const MIN_PATCHES: usize = 2;

/// Most patches that the search over directions looks at.
const SEARCHED: usize = 200;

/// By how much a covariance may have to be inflated for it to describe the shape of the confidence region.
const NONLINEAR: f64 = 4.0;

impl AffinePatches<'_> {
    pub(crate) fn check(&self) -> Result<()> {
        check_lengths(self.points.len(), self.motion.len())?;
        if self.camera.is_none() {
            check_on_plane(self.points)?;
        }
        check_covariances::<6>(self.points.len(), self.covariances, |_, given| is_positive(given))
    }

    /// The usable patches, whitened; of displacements, with a rotation taken out of both views.
    pub(crate) fn system(&self, turn: Option<Derotation>) -> PatchSystem {
        let usable = (0..self.points.len()).filter_map(|k| Some((self.patch(k, turn.as_ref())?, k as u32)));
        let (all, source) = usable.unzip();
        System { all, source }
    }

    fn patch(&self, k: usize, turn: Option<&Derotation>) -> Option<Patch> {
        let (mut m, at) = (Vector6::from(self.motion[k]), self.points[k]);
        let mut covariance = Matrix6::from_row_slice(&self.covariances[36 * k..36 * (k + 1)]);
        let mut ends = [at, [at[0] + m[0], at[1] + m[1]]];
        if let Some(camera) = self.camera {
            let map = affine_map(&camera.scale(), &camera.scale());
            m = map * m;
            covariance = map * covariance * map.transpose();
            ends = ends.map(|at| camera.to_plane(at));
        }
        let Some(turn) = turn else { return Patch::of(ends[0], &m, &covariance, None) };
        let turned = turn.out_of(ends[0], ends[1])?;
        // The map from one view to the other is I + M to first order: with the slopes D_1, D_2 of what turns
        // both views it is D_2 (I + M) D_1^-1.
        let one = Matrix2::identity();
        let slopes = turned.spread * (one + Matrix2::new(m[2], m[4], m[3], m[5])) * turned.first.try_inverse()? - one;
        let map = affine_map(&turned.spread, &turned.first);
        covariance = map * covariance * map.transpose();
        // M_mid = M (I + M / 2)^-1: slopes by the place half way.
        let slopes = slopes * (one + 0.5 * slopes).try_inverse()?;
        m.fixed_rows_mut::<2>(0).copy_from(&turned.left);
        m.fixed_rows_mut::<4>(2).copy_from_slice(slopes.as_slice());
        Patch::of(turned.middle, &m, &covariance, Some(turn))
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
/// [`Error::Argument`](crate::error::Error::Argument) naming what has the wrong length: `flow`, `cov`;
/// `robust`, `weight_inv_depth`, `rotation_prior`, `points_per_independent_sample` and `correlation_length`,
/// which this form does not have.
pub fn estimate_patch_motion(patches: &AffinePatches<'_>, options: &MotionOptions) -> Result<MotionEstimate> {
    patches.check()?;
    let given = |option: Option<f64>, default: f64| option.is_some_and(|value| value != default);
    let refused = [
        ("robust", options.robust),
        ("weight_inv_depth", options.weight_depths.is_some()),
        ("rotation_prior", options.rotation_prior.is_some()),
        ("points_per_independent_sample", given(options.points_per_independent_sample, 1.0)),
        ("correlation_length", given(options.correlation_length, 0.0)),
    ];
    for (name, is_given) in refused {
        refuse_if(is_given, name, "its default, as six numbers are given a patch", "another value")?;
    }
    options.check_common(false)?;
    let covariances = floored(patches.covariances.chunks_exact(36).map(Matrix6::from_row_slice).collect());
    let covariances: Vec<f64> = covariances.iter().flat_map(|given| given.as_slice().to_vec()).collect();
    let patches = AffinePatches { covariances: &covariances, ..*patches };
    Ok(options.threads.check()?.install(|| estimate(&patches, options)))
}

fn estimate(patches: &AffinePatches<'_>, options: &MotionOptions) -> MotionEstimate {
    let (n, unit, errors) = (patches.points.len(), to_plane(patches.camera), options.systematic_errors());
    let is_displaced = options.placement == Placement::Midpoint;
    let without = |w: &Vector3<f64>| patches.system(is_displaced.then(|| Derotation::new(w)));
    let mut system = without(&Vector3::zeros());
    // First the rotation is taken out that explains most of the flow by itself.
    for _ in 0..if is_displaced { ROUNDS } else { 0 } {
        let Some(rotation) = system.rotation_only() else { break };
        system = without(&rotation.rotation);
    }
    if system.all.len() < MIN_PATCHES {
        return MotionEstimate::nothing(n, Status::TooFewPoints, 1.0);
    }
    let free = (6 * system.all.len() - 3) as f64;
    if let Some(rotation) = system.rotation_only().filter(|rotation| by_chance(rotation.chi2, free)) {
        let mut out = MotionEstimate::nothing(n, Status::RotationOnly, 1.0);
        let covariance = rotation.covariance + rotation.systematic_error(system.all.iter().copied(), &errors, &unit);
        let rest = system.all.iter().map(|patch| (patch.f - patch.r * rotation.rotation).norm());
        report_rotation(&mut out, &rotation, &covariance, system.source.iter().copied().zip(rest));
        out.surfaces = vec![[f64::NAN; 3]; n];
        for &source in &system.source {
            (out.surfaces[source as usize], out.inliers[source as usize]) = ([0.0; 3], true);
        }
        return out;
    }
    let rng = CounterRng::new(options.random_state);
    let starts = options.initial.map_or_else(|| starts(&system, rng), |initial| vec![initial.normalized()]);
    let mut minima = minima(&system, starts.iter());
    // Then that of the likeliest minimum, until it stays.
    for _ in 0..if is_displaced { ROUNDS } else { 0 } {
        let Some(w) = minima.first().map(|minimum| minimum.motion.w()) else { break };
        system = without(&w);
        minima = self::minima(&system, minima.iter().map(|minimum| &minimum.motion));
        if minima.first().is_some_and(|minimum| (minimum.motion.w() - w).norm() < ROUNDING) {
            break;
        }
    }
    let Some(best) = minima.first() else {
        return MotionEstimate::nothing(n, Status::TooFewPoints, 1.0);
    };
    let plugged = plugged(&best.equations.h, &best.equations.p);
    let enough = system.all.len() >= UNKNOWNS;
    let wanted = options.method == Method::Efficient || (options.method == Method::Auto && enough);
    let improved = if wanted || plugged.is_none() { shrunk(&system, &best.motion) } else { None };
    let mut out = MotionEstimate::nothing(n, Status::Ok, 1.0);
    out.efficient = wanted && improved.is_some();
    out.fell_back = wanted && improved.is_none();
    let motion = improved.as_ref().filter(|_| wanted).map_or(best.motion, |found| found.motion);
    let tangent = tangents(&motion.u());
    let inverse_at = |surfaces: &[Vector3<f64>]| inverse(&system.equations(&motion, &tangent, Some(surfaces)).h);
    let covariance = match &improved {
        Some(found) => inverse_at(&found.surfaces),
        None => plugged.as_ref().map(|plugged| plugged.likelihood),
    };
    let own = || system.all.iter().map(|patch| patch.seen(&motion).surface).collect();
    let surfaces = improved.filter(|_| wanted).map_or_else(own, |found| found.surfaces);
    let again = |_| covariance_factor(&system, &motion, &surfaces, out.efficient, rng.stream(2));
    let wider = plugged.as_ref().map_or(1.0, again);
    if let Some(inverse) = inverse_at(&surfaces).filter(|_| covariance.is_some()) {
        out.systematic_errors = errors.on((&inverse, &system.response(&motion, &surfaces)), &motion.w(), &unit);
    }
    let covariance = covariance.map(|covariance| covariance * wider + out.systematic_errors.added());
    set_motion(&mut out, &motion, &tangent, covariance.as_ref(), &system.equations(&motion, &tangent, None));
    out.likelihood = likelihood(best, plugged.as_ref());
    report_surfaces(&mut out, &system, &surfaces);
    let own = if out.direction_std.is_finite() { out.direction_std } else { 0.0 };
    out.alternatives = others(&system, &motion, minima.iter().map(|minimum| minimum.motion), own);
    // Patches at one place determine no more surfaces than one of less noise.
    let place = |&k: &u32| patches.points[k as usize].map(f64::to_bits);
    out.status = if system.source.iter().map(place).collect::<HashSet<_>>().len() < UNKNOWNS {
        Status::FewPoints
    } else if out.direction_std.is_nan() || out.direction_std > WIDE {
        Status::IllConditioned
    } else if !out.alternatives.is_empty() {
        Status::Ambiguous
    } else if plugged.is_none() || wider > NONLINEAR {
        Status::LowSnr
    } else {
        Status::Ok
    };
    out
}

/// The best directions of the half sphere, both signs each.
fn starts(system: &PatchSystem, rng: CounterRng) -> Vec<Motion> {
    let few = system.subset(&rng.sample(system.all.len(), SEARCHED));
    let found = evaluate(|u| few.best_rotation(u).map(|(w, cost)| (Motion::of(u, &w), cost)));
    apart(found, APART, STARTS).into_iter().flat_map(|(start, _)| [start, start.reversed()]).collect()
}

/// The minima that are reached from `starts`, sorted by what residuals and patches behind the camera cost.
fn minima<'a>(system: &PatchSystem, starts: impl Iterator<Item = &'a Motion>) -> Vec<Minimum> {
    let cost = |minimum: &Minimum| minimum.equations.cost + minimum.equations.behind;
    let mut minima: Vec<Minimum> =
        starts.map(|start| system.refine(start)).filter(|minimum| cost(minimum).is_finite()).collect();
    minima.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
    minima
}

/// Depths, times to contact and residuals of the patches, with the surfaces in the weights.
fn report_surfaces(out: &mut MotionEstimate, system: &PatchSystem, surfaces: &[Vector3<f64>]) {
    let (rates, motion) = (Rates::new(&out.uncertain()), out.motion);
    out.surfaces = vec![[f64::NAN; 3]; out.inliers.len()];
    for ((patch, &source), surface) in system.all.iter().zip(&system.source).zip(surfaces) {
        let (source, seen) = (source as usize, patch.seen(&motion));
        out.inverse_depth[source] = seen.surface[0];
        out.inverse_depth_std[source] = seen.covariance[(0, 0)].sqrt();
        out.inverse_depth_smooth[source] = surface[0];
        out.surfaces[source] = (*surface).into();
        out.residuals[source] = seen.cost.sqrt();
        out.inliers[source] = true;
        (out.time_to_contact[source], out.time_to_contact_std[source]) =
            rates.contact(surface[0], seen.covariance[(0, 0)], &rates.slopes(patch, surface));
    }
}

/// Other minima, and the opposites of all, that are about as likely with no patch behind the camera: each
/// with the direction and the rotation that suit it best; the likeliest first.
fn others(
    system: &PatchSystem,
    motion: &Motion,
    minima: impl Iterator<Item = Motion>,
    deviation: f64,
) -> Vec<Alternative> {
    let least = system.refine_in_front(motion).equations.cost;
    let distinct = (DISTINCT * deviation).max(SAME).to_radians();
    // Residuals of other minima are other components of the noise.
    let limit = SURE + (3.0 * system.all.len() as f64).sqrt();
    let starts = minima.flat_map(|minimum| [minimum, minimum.reversed()]);
    let found = starts.map(|start| system.refine_in_front(&start));
    let found = found.map(|other| Alternative { motion: other.motion, excess: other.equations.cost - least });
    let is_other = |other: &Alternative| other.excess < limit && other.motion.angle_to(motion) > distinct;
    let mut found = different(found.filter(is_other), deviation.max(SAME));
    found.sort_by(|a, b| a.excess.total_cmp(&b.excess));
    found
}
