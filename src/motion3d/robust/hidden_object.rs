//! Whether the points are those of two motions although one motion explains nearly all of them.
//!
//! Where noise hides the difference, the points of an object and of the scene can fit a third motion down to
//! the noise. No residual shows that. But the motion of the scene is then another one, which fits all points
//! except those of one region, and its depth map is as smooth and as far in front of the camera.

use super::cells::Cells;
use super::search::GraduatedWeights;
use super::{APART, Candidates, CompetingMotion, INLIER, STOPPING, cheaper_sign, inliers_of, truncated};
use crate::math::random::CounterRng;
use crate::motion3d::kernels::equations;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::options::Smoother;
use crate::motion3d::model::rows::tangents;
use crate::motion3d::solver::covariance::{direction_deviation, inverse};
use crate::motion3d::solver::likelihood::cost_of;
use crate::motion3d::solver::profile_likelihood::ROUND;
use crate::motion3d::solver::refine::refine;
use crate::motion3d::solver::smoothing::DepthSmoother;
use crate::motion3d::solver::starts::at_most;

/// Fewer points have no regions.
const MIN_POINTS: usize = 50;

/// The share of the points that the first motion must fit: else the object is seen already.
const MIN_FITTED: f64 = 0.85;

/// Standard deviation of the direction, degrees, below which noise hides no object.
const MIN_DIRECTION_STD: f64 = 0.3;

/// Share of the points that the scene must have, and that an object may have at most.
const MIN_SCENE: f64 = 0.55;
const MAX_OBJECT: f64 = 0.4;

/// Mean share of the neighbours of an object's points that the scene's motion does not fit either.
const MIN_COHERENCE: f64 = 0.4;

/// Standard deviations of the first direction within which another one is the same.
const MAX_SAME: f64 = 2.5;

/// By how much, in units of `sqrt(n)`, the depth map of the other motion may be less likely.
const MAX_ROUGHER: f64 = 1.0;

/// Points and starts of the search outside of one region, and refinements of what it finds.
const SEARCHED: usize = 200;
const STARTS: usize = 2;
const ROUNDS: usize = 3;

/// The motion of the points outside of one region, where it differs from `best`, which fits nearly all
/// points.
pub(crate) fn hidden_object(
    observations: &Observations,
    cells: &Cells,
    best: &Motion,
    candidates: &Candidates,
    rng: CounterRng,
) -> Option<CompetingMotion> {
    let fitted = inliers_of(observations, best);
    if observations.n < MIN_POINTS || (fitted.len() as f64) < MIN_FITTED * observations.n as f64 {
        return None;
    }
    let at = equations(observations, best, &tangents(&best.u()), None);
    let deviation = direction_deviation(&inverse(&at.h)?);
    if deviation < MIN_DIRECTION_STD {
        return None;
    }
    let mut motions: Vec<Motion> = candidates.iter().skip(1).map(|(motion, _)| *motion).collect();
    for (place, region) in cells.halves(observations.n / 4).into_iter().enumerate() {
        motions.extend(outside(observations, region, rng.stream(place as u64)));
    }
    let distinct = APART.max(MAX_SAME * deviation);
    let mut others: Vec<(Motion, Vec<u32>)> = motions
        .into_iter()
        .filter_map(|motion| of_scene(observations, motion))
        .filter(|(motion, scene)| {
            motion.angle_to(best).to_degrees() > distinct && is_one_region(cells, &fitted, scene, observations.n)
        })
        .collect();
    others.sort_by_key(|(_, scene)| std::cmp::Reverse(scene.len()));
    // Elongated noise leaves depths that are too noisy to be compared.
    let compares = observations.longest() < ROUND;
    let likely = |(motion, scene): &&(Motion, Vec<u32>)| {
        !compares || rougher(observations, scene, [best, motion], rng.stream(20)) < MAX_ROUGHER
    };
    let (motion, _) = others.iter().find(likely)?;
    let excess = truncated(observations, motion, INLIER) - truncated(observations, best, INLIER);
    Some(CompetingMotion { motion: *motion, excess: excess.max(0.0) })
}

/// Motions that a search without the points of a `region` finds.
fn outside(observations: &Observations, region: &[u32], rng: CounterRng) -> Vec<Motion> {
    let mut is_inside = vec![false; observations.n];
    for &k in region {
        is_inside[k as usize] = true;
    }
    let rest: Vec<u32> = (0..observations.n as u32).filter(|&k| !is_inside[k as usize]).collect();
    let rest = observations.subset(&rest);
    let rest = &*at_most(&rest, SEARCHED, rng.stream(1));
    let found = GraduatedWeights::new(rest).motions(STARTS, rng);
    found.into_iter().map(|motion| cheaper_sign(rest, motion).0).collect()
}

/// The motion refined on the points that it fits, and these; `None` where they are too few for a scene.
fn of_scene(observations: &Observations, mut motion: Motion) -> Option<(Motion, Vec<u32>)> {
    let least = MIN_SCENE * observations.n as f64;
    let mut fitted = inliers_of(observations, &motion);
    for _ in 0..ROUNDS {
        if (fitted.len() as f64) < least {
            return None;
        }
        motion = refine(&observations.subset(&fitted), motion, STOPPING).motion;
        fitted = inliers_of(observations, &motion);
    }
    (fitted.len() as f64 >= least).then_some((motion, fitted))
}

/// Whether the points that only the first motion fits lie together, as those of an object do.
fn is_one_region(cells: &Cells, fitted: &[u32], scene: &[u32], n: usize) -> bool {
    let mut is_scene = vec![false; n];
    for &k in scene {
        is_scene[k as usize] = true;
    }
    let rejected = cells.rejected(&is_scene);
    let lost: Vec<f64> = fitted.iter().filter(|&&k| !is_scene[k as usize]).map(|&k| rejected[k as usize]).collect();
    let coherence = lost.iter().sum::<f64>() / lost.len().max(1) as f64;
    (lost.len() as f64) < MAX_OBJECT * n as f64 && coherence > MIN_COHERENCE
}

/// By how much the second motion with its depths is less likely on the points of the scene than the first, in
/// units of `sqrt(n)`.
fn rougher(observations: &Observations, scene: &[u32], motions: [&Motion; 2], rng: CounterRng) -> f64 {
    let points = observations.subset(scene);
    let smoother = DepthSmoother::new(&points, Smoother::Auto, rng);
    let [first, second] = motions.map(|motion| cost_of(&points, &smoother, motion));
    (second - first) / (points.n as f64).sqrt()
}
