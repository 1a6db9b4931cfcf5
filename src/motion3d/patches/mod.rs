//! Motion from six numbers a patch, flow and Jacobian: three constraints each, where flow alone gives one.
//!
//! It pays for few, large patches seen through a long lens; noisy slants used as weights make maximum
//! likelihood worse than flow alone, so that they are shrunk.
//!
//! `system` has the equations, `shrinkage` solves them with shrunk slants and tests the covariance of few
//! patches, `report` assembles the result and judges it.

mod report;
mod shrinkage;
mod system;

use crate::error::{Error, Result};
use crate::math::by_chance;
use crate::math::random::CounterRng;
use crate::motion3d::bound::{MotionBound, check_motion, with_known_depth};
use crate::motion3d::diagnostics::report::likelihood;
use crate::motion3d::model::input::{Placement, affine_map, check_covariances, check_lengths, is_positive, to_plane};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::options::{Method, MotionOptions};
use crate::motion3d::model::result::{CommonEffect, MotionEstimate, Status};
use crate::motion3d::model::rows::{Derotation, tangents};
use crate::motion3d::model::whitening::floored;
use crate::motion3d::solver::covariance::{inverse, plugged};
use crate::motion3d::solver::finite_rotation::{ROUNDING, ROUNDS};
use crate::motion3d::solver::refine::Minimum;
use crate::motion3d::solver::starts::{APART, STARTS, apart, evaluate};
use crate::types::Intrinsics;
use nalgebra::{Matrix2, Matrix6, Vector3, Vector6};
use report::{judge, report_motion, turning_report};
use shrinkage::{covariance_factor, shrunk};
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

/// Least number of patches for a motion; for a nearly unique one and for a distribution of surfaces.
const MIN_PATCHES: usize = 2;
const FEW: usize = 5;

/// Most patches that the search over directions looks at.
const SEARCHED: usize = 200;

/// By how much a covariance may have to be inflated for it to describe the shape of the confidence region.
const NONLINEAR: f64 = 4.0;

impl AffinePatches<'_> {
    fn check(&self) -> Result<()> {
        check_lengths(self.points.len(), self.motion.len())?;
        check_covariances::<6>(self.points.len(), self.covariances, |_, given| is_positive(given))
    }

    /// The usable patches, whitened; of displacements, with the rotation `w` taken out of both views.
    fn system(&self, placement: Placement, w: &Vector3<f64>) -> System {
        let turn = (placement == Placement::Midpoint).then(|| Derotation::new(w));
        let usable = (0..self.points.len()).filter_map(|k| Some((self.patch(k, turn.as_ref())?, k as u32)));
        let (patches, source) = usable.unzip();
        System { patches, source }
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
        let Some(turn) = turn else { return Patch::new(ends[0], &m, &covariance, None) };
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
        Patch::new(turned.middle, &m, &covariance, Some(turn))
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
    let given = |option: Option<f64>, default: f64| option.is_some_and(|value| value != default);
    let refused = [
        ("robust", options.robust),
        ("weight_inv_depth", options.weight_depths.is_some()),
        ("rotation_prior", options.rotation_prior.is_some()),
        ("points_per_independent_sample", given(options.points_per_independent_sample, 1.0)),
        ("correlation_length", given(options.correlation_length, 0.0)),
    ];
    if let Some((name, _)) = refused.iter().find(|(_, is_given)| *is_given) {
        return Err(Error::argument(name, "its default, as six numbers are given a patch", "another value"));
    }
    options.check_common(false)?;
    let covariances = floored(patches.covariances.chunks_exact(36).map(Matrix6::from_row_slice).collect());
    let covariances: Vec<f64> = covariances.iter().flat_map(|given| given.as_slice().to_vec()).collect();
    let patches = AffinePatches { covariances: &covariances, ..*patches };
    Ok(options.threads.check()?.install(|| estimate(&patches, options)))
}

fn estimate(patches: &AffinePatches<'_>, options: &MotionOptions) -> MotionEstimate {
    let (n, placement) = (patches.points.len(), options.placement);
    let mut system = patches.system(placement, &Vector3::zeros());
    // First the rotation is taken out that explains most of the flow by itself.
    for _ in 0..if placement == Placement::Midpoint { ROUNDS } else { 0 } {
        let Some(rotation) = system.rotation_only() else { break };
        system = patches.system(placement, &rotation.rotation);
    }
    if system.patches.len() < MIN_PATCHES {
        return MotionEstimate::nothing(n, Status::TooFewPoints, 1.0);
    }
    let free = (6 * system.patches.len() - 3) as f64;
    if let Some(rotation) = system.rotation_only().filter(|rotation| by_chance(rotation.chi2, free)) {
        return turning_report(&system, n, &rotation, &options.systematic_errors(), &to_plane(patches.camera));
    }
    let rng = CounterRng::new(options.random_state);
    let mut minima = match options.initial {
        Some(initial) => vec![system.refine(&initial.normalized())],
        None => minima(&system, rng),
    };
    settle(patches, placement, &mut system, &mut minima);
    let system = &system;
    let Some(best) = minima.first() else {
        return MotionEstimate::nothing(n, Status::TooFewPoints, 1.0);
    };
    let plugged = plugged(&best.equations.h, &best.equations.p);
    let enough = system.patches.len() >= FEW;
    let wanted = options.method == Method::Efficient || (options.method == Method::Auto && enough);
    let improved = if wanted || plugged.is_none() { shrunk(system, &best.motion) } else { None };
    let mut out = MotionEstimate::nothing(n, Status::Ok, 1.0);
    out.fell_back = wanted && improved.is_none();
    let (mut motion, mut covariance) = (best.motion, plugged.as_ref().map(|plugged| plugged.likelihood));
    let mut surfaces = None;
    if let Some(found) = improved {
        if wanted {
            motion = found.motion;
        }
        covariance = inverse(&system.equations(&motion, &tangents(&motion.u()), Some(&found.surfaces)).h);
        surfaces = wanted.then_some(found.surfaces);
    }
    out.efficient = surfaces.is_some();
    let own = || system.patches.iter().map(|patch| patch.seen(&motion).surface).collect();
    let depths: Vec<Vector3<f64>> = surfaces.clone().unwrap_or_else(own);
    let again = |_| covariance_factor(system, &motion, &depths, out.efficient, rng.stream(2));
    let wider = plugged.as_ref().map_or(1.0, again);
    let displaced = (&system.moved(&motion, &depths), &to_plane(patches.camera));
    let common = |covariance| options.systematic_errors().on(&covariance, &motion, None, displaced);
    out.common = covariance.map_or_else(CommonEffect::default, common);
    covariance = covariance.map(|covariance| covariance * wider + out.common.added());
    let low = plugged.is_none() || wider > NONLINEAR;
    report_motion(&mut out, system, &motion, covariance, surfaces.as_deref());
    out.likelihood = likelihood(best, plugged.as_ref());
    // Patches at one place determine no more surfaces than one of less noise.
    let place = |&k: &u32| patches.points[k as usize].map(f64::to_bits);
    let places = system.source.iter().map(place).collect::<HashSet<_>>().len();
    let minima: Vec<Motion> = minima.iter().map(|minimum| minimum.motion).collect();
    judge(&mut out, system, &minima, places, low);
    out
}

/// The minima that are reached from the best directions of the half sphere, both signs each, the cheapest
/// first.
fn minima(system: &System, rng: CounterRng) -> Vec<Minimum> {
    let few = system.subset(&rng.sample(system.patches.len(), SEARCHED));
    let found = evaluate(|u| few.best_rotation(u).map(|(w, cost)| (Motion::of(u, &w), cost)));
    let refined = apart(found, APART, STARTS).into_iter().map(|(start, _)| system.refine(&start));
    let both = refined.flat_map(|minimum| {
        let motion = minimum.motion.reversed();
        let tangent = tangents(&motion.u());
        [minimum, Minimum { motion, tangent, equations: system.equations(&motion, &tangent, None) }]
    });
    cheapest(both)
}

/// Sorted by what residuals and patches behind the camera cost.
fn cheapest(minima: impl Iterator<Item = Minimum>) -> Vec<Minimum> {
    let cost = |minimum: &Minimum| minimum.equations.cost + minimum.equations.behind;
    let mut minima: Vec<Minimum> = minima.filter(|minimum| cost(minimum).is_finite()).collect();
    minima.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
    minima
}

/// Takes the rotation of the likeliest minimum out of displacements, and refines all again, until it stays.
fn settle(patches: &AffinePatches<'_>, placement: Placement, system: &mut System, minima: &mut Vec<Minimum>) {
    for _ in 0..if placement == Placement::Midpoint { ROUNDS } else { 0 } {
        let Some(w) = minima.first().map(|minimum| minimum.motion.w()) else { break };
        *system = patches.system(placement, &w);
        *minima = cheapest(minima.iter().map(|minimum| system.refine(&minimum.motion)));
        if minima.first().is_some_and(|minimum| (minimum.motion.w() - w).norm() < ROUNDING) {
            break;
        }
    }
}

/// As [`motion_bound`](crate::motion3d::motion_bound), for six numbers a patch whose true `(nu, nu_x, nu_y)`
/// are given; their flow is not looked at.
///
/// # Errors
/// As [`motion_bound`](crate::motion3d::motion_bound).
pub fn patch_motion_bound(patches: &AffinePatches<'_>, motion: &Motion, surfaces: &[[f64; 3]]) -> Result<MotionBound> {
    patches.check()?;
    check_motion(&motion.translation, &motion.rotation)?;
    let system = patches.system(Placement::Start, &Vector3::zeros());
    let finite = |surface: &[f64; 3]| surface.iter().all(|value| value.is_finite());
    let known = with_known_depth(&system.source, (patches.points, surfaces), finite, MIN_PATCHES)?;
    let system = system.subset(&known);
    let surfaces: Vec<Vector3<f64>> = system.source.iter().map(|&k| surfaces[k as usize].into()).collect();
    let tangent = tangents(&motion.u());
    let truth = system.equations(motion, &tangent, Some(&surfaces));
    MotionBound::of(&tangent, &truth.h, &truth.p, |bound| system.weighted_noise(motion, &tangent, &surfaces, bound))
}
