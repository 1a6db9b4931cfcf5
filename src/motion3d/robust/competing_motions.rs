//! Motions apart from the one with the most inliers, and the choice among several with many outliers.

use super::cells::Cells;
use super::depth_consistency::DepthConsistency;
use super::search::{GraduatedWeights, graduated};
use super::{APART, CompetingMotion, INLIER, MAJORITY, cheaper_sign, inliers_of, mixture};
use crate::math::random::CounterRng;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::solver::starts::sample;
use rayon::prelude::*;

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
) -> Option<(Motion, Vec<CompetingMotion>)> {
    let cells = Cells::new(on);
    let own = DepthConsistency::new(on, &cells);
    let refined = candidates.par_iter().filter_map(|(motion, _)| {
        let (motion, cost) = mixture::refined_by_posterior(on, &own, *motion)?;
        Some((motion, cost, inliers_of(on, &motion)))
    });
    let mut found: Vec<(Motion, f64, Vec<u32>)> = refined.collect();
    found.sort_by(|a, b| a.1.total_cmp(&b.1));
    let majority = MAJORITY * on.n as f64;
    // The motion of an object may be the likeliest, but it is not the scene's.
    let most = found.iter().map(|(_, _, inliers)| inliers.len()).max()?;
    let scene = found.iter().position(|(_, _, inliers)| inliers.len() as f64 > most as f64 - majority)?;
    let (best, cost, own) = found.remove(scene);
    let mut competing: Vec<CompetingMotion> = Vec::new();
    for (motion, other, inliers) in &found {
        let alone = inliers.iter().filter(|k| own.binary_search(k).is_err()).count() as f64;
        let as_many = alone > majority && inliers.len() as f64 > own.len() as f64 - majority;
        let as_likely = *other < cost + UNDECIDED * (on.n as f64).sqrt();
        let same = |known: &Motion| known.angle_to(motion).to_degrees() < APART;
        if (as_many || as_likely) && !same(&best) && !competing.iter().any(|competitor| same(&competitor.motion)) {
            competing.push(CompetingMotion { motion: *motion, excess: (other - cost).max(0.0) });
        }
    }
    let best = if on.n == observations.n { best } else { mixture::refined_by_posterior(observations, gate, best)?.0 };
    Some((best, competing))
}

/// Searches the motion with the most inliers among the outliers of `best` and refines it on all points, if
/// they are so many that they may be the scene. All starts of the first search may end at the motion of one
/// object.
pub(crate) fn second(observations: &Observations, best: Motion, rng: CounterRng) -> Option<(Motion, f64)> {
    let inliers = inliers_of(observations, &best);
    let rejected: Vec<u32> = (0..observations.n as u32).filter(|k| inliers.binary_search(k).is_err()).collect();
    if rejected.len() < MIN_REJECTED || (rejected.len() as f64) < MAJORITY * observations.n as f64 {
        return None;
    }
    // What may be the scene is much of the rejected: few of them show it.
    let chosen = sample(rejected.len(), REJECTED, rng.stream(8));
    let rest = observations.subset(&chosen.iter().map(|&place| rejected[place as usize]).collect::<Vec<u32>>());
    let found = GraduatedWeights::new(&rest).motions(1, rng).pop()?;
    let found = cheaper_sign(&rest, found).0;
    Some(cheaper_sign(observations, graduated(observations, found, INLIER)))
}

/// Of the candidates, cheapest first, those that have fewer inliers than the first only because other points
/// fit them.
pub(crate) fn competing_motions(observations: &Observations, candidates: &[(Motion, f64)]) -> Vec<CompetingMotion> {
    let (majority, best) = (MAJORITY * observations.n as f64, candidates[0]);
    let inliers_of_best = inliers_of(observations, &best.0);
    let limit = best.1 + INLIER * INLIER * majority;
    let mut found: Vec<CompetingMotion> = Vec::new();
    for (motion, cost) in candidates.iter().skip(1).take_while(|(_, cost)| *cost < limit) {
        let same = |other: &Motion| other.angle_to(motion).to_degrees() < APART;
        let inliers = inliers_of(observations, motion);
        let new = inliers.iter().filter(|k| inliers_of_best.binary_search(k).is_err()).count() as f64;
        if new > majority && !same(&best.0) && !found.iter().any(|competitor| same(&competitor.motion)) {
            found.push(CompetingMotion { motion: *motion, excess: cost - best.1 });
        }
    }
    found
}
