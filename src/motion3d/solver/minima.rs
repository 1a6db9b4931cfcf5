//! Which minimum the smoothed weights prefer.

use super::covariance::direction_deviation;
use super::efficient::{Efficient, WeightDepths, efficient};
use super::likelihood;
use super::likelihood::Candidate;
use super::smoothing::DepthSmoother;
use crate::motion3d::kernels::{depths, equations};
use crate::motion3d::model::motion::{Motion, tangents};
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::options::MotionOptions;
use crate::motion3d::model::result::Alternative;

/// Most minima from which smoothed weights are tried.
const TRIED: usize = 3;

/// Two solutions whose costs, which fluctuate by about `2 sqrt(n)`, differ by less than this times `sqrt(n)`
/// are as likely.
const UNDECIDED: f64 = 1.5;

/// Solutions nearer than so many deviations are one.
pub(crate) const DISTINCT: f64 = 3.0;

/// The likeliest solution, and another that is about as likely.
pub(crate) struct Trial {
    pub best: Efficient,
    pub undecided: Option<Alternative>,
}

/// The smoothed weights' solution, from whichever of the minima leads to the likeliest: a spurious minimum,
/// whose epipole sits among noisy points, may lead nowhere, and without the noise of its depths a motion is
/// easier to judge.
pub(crate) fn smoothed(
    inliers: &Observations,
    options: &MotionOptions,
    candidates: &[Candidate],
    made: Option<DepthSmoother>,
    smoother: impl FnOnce() -> DepthSmoother,
) -> Option<Trial> {
    let starts = close(candidates, inliers.n);
    if let Some(depths) = &options.weight_depths {
        let mut nu: Vec<f64> = inliers.source.iter().map(|&k| depths[k as usize]).collect();
        nu.resize(inliers.stride, 0.0);
        let known = |start: &Candidate| efficient(inliers, start.motion(), WeightDepths::Known(nu.clone()));
        return starts.iter().find_map(known).map(|best| Trial { best, undecided: None });
    }
    let mut smoother = made.unwrap_or_else(smoother);
    let mut found: Vec<Efficient> = starts
        .iter()
        .take(TRIED)
        .filter_map(|start| efficient(inliers, start.motion(), WeightDepths::Smoothed(&mut smoother)))
        .collect();
    if found.len() < 2 {
        return found.pop().map(|best| Trial { best, undecided: None });
    }
    let costs: Vec<f64> = found.iter().map(|found| cost_of(inliers, &smoother, &found.motion)).collect();
    let best = (1..found.len()).fold(0, |best, k| if costs[k] < costs[best] { k } else { best });
    let undecided = undecided(&found, &costs, best, inliers.n);
    Some(Trial { best: found.swap_remove(best), undecided })
}

/// The likeliest of the other solutions, if it is about as likely as the best.
fn undecided(found: &[Efficient], costs: &[f64], best: usize, n: usize) -> Option<Alternative> {
    let deviation = DISTINCT * direction_deviation(&found[best].covariance);
    let other = |k: &usize| found[best].motion.angle_to(&found[*k].motion).to_degrees() > deviation;
    let next = (0..found.len()).filter(other).min_by(|&a, &b| costs[a].total_cmp(&costs[b]))?;
    let excess = costs[next] - costs[best];
    (excess < UNDECIDED * (n as f64).sqrt()).then_some(Alternative { motion: found[next].motion, excess })
}

/// `J`, the depths behind the camera and the depth map's roughness.
fn cost_of(observations: &Observations, smoother: &DepthSmoother, motion: &Motion) -> f64 {
    let at = equations(observations, motion, &tangents(&motion.u()), None);
    at.cost + at.behind + smoother.cost(&depths(observations, motion))
}

/// The chosen minimum and those that come close to it.
pub(crate) fn close(candidates: &[Candidate], n: usize) -> &[Candidate] {
    let limit = candidates[0].cost + likelihood::close(n);
    let count = candidates.iter().take_while(|other| other.cost < limit).count();
    &candidates[..count.max(1)]
}
