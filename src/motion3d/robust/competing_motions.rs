//! Motions apart from the one with the most inliers, and the choice among several with many outliers.
//!
//! Where noise hides the difference, the points of an object and of the scene can fit a third motion down to
//! the noise. No residual shows that. But the motion of the scene is then another one, which fits all points
//! except those of one region, and its depth map is as smooth and as far in front of the camera.

use super::depth_consistency::{DepthConsistency, Judged};
use super::outlier_posterior::{ROUNDS, SETTLED, posterior, weighted};
use super::search::{graduated, robust_motions};
use super::two_motions::MIN_TESTED;
use super::{APART, Candidates, INLIER, MAJORITY, cheaper_sign, inliers_of, settle, truncated};
use crate::math::{random::CounterRng, tangents};
use crate::motion3d::kernels::equations;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::{Observations, ROUND, UNKNOWNS};
use crate::motion3d::model::result::Alternative;
use crate::motion3d::solver::covariance::{direction_deviation, inverse};
use crate::motion3d::solver::depth_smoother;
use crate::motion3d::solver::efficient::solve;
use crate::motion3d::solver::likelihood::cost_of;
use crate::motion3d::solver::starts::at_most;
use crate::parallel;
use crate::scattered::Smoother;

/// Maximum number of outliers among which a second motion is searched.
const REJECTED: usize = 128;

/// Fewest rejected points among which there may be another motion.
const MIN_REJECTED: usize = 20;

/// Two motions whose costs, which fluctuate by about `2 sqrt(n)`, differ by less than this times `sqrt(n)`
/// are as likely.
const UNDECIDED: f64 = 1.0;

/// Chooses the motion from all candidates if so many outliers fit by chance that least squares follow them;
/// with others that are about as likely, or that have about as many inliers.
pub(crate) fn among_many_outliers(
    observations: &Observations,
    on: &Observations,
    gate: &DepthConsistency<'_>,
    candidates: &[(Motion, f64)],
) -> Option<(Motion, Vec<Alternative>)> {
    let own = DepthConsistency::new(on);
    let refined = parallel::map(candidates, |(motion, _)| {
        let (motion, cost) = refined_by_posterior(on, &own, *motion)?;
        Some((motion, cost, inliers_of(on, &motion)))
    });
    let mut found: Vec<(Motion, f64, Vec<u32>)> = refined.into_iter().flatten().collect();
    found.sort_by(|a, b| a.1.total_cmp(&b.1));
    let majority = MAJORITY * on.n as f64;
    // The motion of an object may be the likeliest, but it is not the scene's.
    let most = found.iter().map(|(_, _, inliers)| inliers.len()).max()?;
    let scene = found.iter().position(|(_, _, inliers)| inliers.len() as f64 > most as f64 - majority)?;
    let (best, cost, own) = found.remove(scene);
    let mut competing: Vec<Alternative> = Vec::new();
    for (motion, other, inliers) in &found {
        let alone = inliers.iter().filter(|k| own.binary_search(k).is_err()).count() as f64;
        let as_many = alone > majority && inliers.len() as f64 > own.len() as f64 - majority;
        let as_likely = *other < cost + UNDECIDED * (on.n as f64).sqrt();
        let same = |known: &Motion| known.angle_to(motion).to_degrees() < APART;
        if (as_many || as_likely) && !same(&best) && !competing.iter().any(|competitor| same(&competitor.motion)) {
            competing.push(Alternative { motion: *motion, excess: (other - cost).max(0.0) });
        }
    }
    let best = if on.n == observations.n { best } else { refined_by_posterior(observations, gate, best)?.0 };
    Some((best, competing))
}

/// From a motion that was found by least squares to the root of the equation with probabilities, with
/// updated probabilities on the way; with its cost. `None` if too few are inliers.
///
/// Outliers with depths of their own, which are large, weigh most in least squares; drawn to their
/// neighbours' they weigh as inliers do.
fn refined_by_posterior(all: &Observations, gate: &DepthConsistency<'_>, start: Motion) -> Option<(Motion, f64)> {
    let (mut motion, mut rounds) = (start, 0..ROUNDS);
    loop {
        let inliers = inliers_of(all, &motion);
        let Judged { outliers, smooth, cost } = gate.judged(&motion, &inliers).filter(|_| inliers.len() >= UNKNOWNS)?;
        if rounds.next().is_none() {
            return Some((motion, cost));
        }
        let points = weighted(all, &motion, |k, density| Some(posterior(&outliers.of(k)?, density)));
        let Some(next) = solve(&points, &motion, &smooth) else { return Some((motion, cost)) };
        if next.angle_to(&motion) < SETTLED {
            rounds = 0..0;
        }
        motion = next;
    }
}

/// Searches the motion with the most inliers among the outliers of `best` and refines it on all points, if
/// they are so many that they may be the scene. All starts of the first search may end at the motion of one
/// object.
pub(crate) fn second(observations: &Observations, best: Motion, rng: CounterRng) -> Option<(Motion, f64)> {
    let rejected = observations.others(&inliers_of(observations, &best));
    if rejected.len() < MIN_REJECTED || (rejected.len() as f64) < MAJORITY * observations.n as f64 {
        return None;
    }
    // What may be the scene is much of the rejected: few of them show it.
    let chosen = rng.stream(8).sample(rejected.len(), REJECTED);
    let rest = observations.subset(&chosen.iter().map(|&place| rejected[place as usize]).collect::<Vec<u32>>());
    let found = robust_motions(&rest, 1, rng).pop()?;
    let found = cheaper_sign(&rest, found).0;
    Some(cheaper_sign(observations, graduated(observations, found, INLIER)))
}

/// Of the candidates, cheapest first, those that have fewer inliers than the first only because other points
/// fit them.
pub(crate) fn competing_motions(observations: &Observations, candidates: &[(Motion, f64)]) -> Vec<Alternative> {
    let (majority, best) = (MAJORITY * observations.n as f64, candidates[0]);
    let inliers_of_best = inliers_of(observations, &best.0);
    let limit = best.1 + INLIER * INLIER * majority;
    let mut found: Vec<Alternative> = Vec::new();
    for (motion, cost) in candidates.iter().skip(1).take_while(|(_, cost)| *cost < limit) {
        let same = |other: &Motion| other.angle_to(motion).to_degrees() < APART;
        let inliers = inliers_of(observations, motion);
        let new = inliers.iter().filter(|k| inliers_of_best.binary_search(k).is_err()).count() as f64;
        if new > majority && !same(&best.0) && !found.iter().any(|competitor| same(&competitor.motion)) {
            found.push(Alternative { motion: *motion, excess: cost - best.1 });
        }
    }
    found
}

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

/// Points and starts of the search outside of one region.
const SEARCHED: usize = 200;
const STARTS: usize = 2;

/// The motion of the points outside of one region, where it differs from `best`, which fits nearly all
/// points.
pub(crate) fn hidden_object(
    observations: &Observations,
    cells: &DepthConsistency<'_>,
    best: &Motion,
    candidates: &Candidates,
    rng: CounterRng,
) -> Option<Alternative> {
    let fitted = inliers_of(observations, best);
    if observations.n < MIN_TESTED || (fitted.len() as f64) < MIN_FITTED * observations.n as f64 {
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
            motion.angle_to(best).to_degrees() > distinct && is_one_region(observations, cells, &fitted, scene)
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
    Some(Alternative { motion: *motion, excess: excess.max(0.0) })
}

/// Motions that a search without the points of a `region` finds.
fn outside(observations: &Observations, region: &[u32], rng: CounterRng) -> Vec<Motion> {
    let rest = observations.subset(&observations.others(region));
    let rest = &*at_most(&rest, SEARCHED, rng.stream(1));
    let found = robust_motions(rest, STARTS, rng);
    found.into_iter().map(|motion| cheaper_sign(rest, motion).0).collect()
}

/// The motion refined on the points that it fits, and these; `None` where they are too few for a scene.
fn of_scene(observations: &Observations, motion: Motion) -> Option<(Motion, Vec<u32>)> {
    let enough = |inliers: &[u32]| inliers.len() as f64 >= MIN_SCENE * observations.n as f64;
    if !enough(&inliers_of(observations, &motion)) {
        return None;
    }
    let found = settle(observations, motion)?;
    enough(&found.inliers).then_some((found.motion, found.inliers))
}

/// Whether the points that only the first motion fits lie together, as those of an object do.
fn is_one_region(observations: &Observations, cells: &DepthConsistency<'_>, fitted: &[u32], scene: &[u32]) -> bool {
    let is_scene = observations.mask(scene);
    let rejected = cells.rejected(&is_scene);
    let lost: Vec<f64> = fitted.iter().filter(|&&k| !is_scene[k as usize]).map(|&k| rejected[k as usize]).collect();
    let coherence = lost.iter().sum::<f64>() / lost.len().max(1) as f64;
    (lost.len() as f64) < MAX_OBJECT * observations.n as f64 && coherence > MIN_COHERENCE
}

/// By how much the second motion with its depths is less likely on the points of the scene than the first, in
/// units of `sqrt(n)`.
fn rougher(observations: &Observations, scene: &[u32], motions: [&Motion; 2], rng: CounterRng) -> f64 {
    let points = observations.subset(scene);
    let smoother = depth_smoother(&points, Smoother::Auto, rng);
    let [first, second] = motions.map(|motion| cost_of(&points, &smoother, motion));
    (second - first) / (points.n as f64).sqrt()
}
