//! Maximum likelihood over all motions, and which of several minima it was.

use super::covariance::direction_deviation;
use super::efficient::{Efficient, WeightDepths, efficient};
use super::refine::{FEWER, MANY, Minimum, StoppingCriteria, refine};
use super::smoothing::DepthSmoother;
use super::starts::{sample, starts};
use crate::math::random::CounterRng;
use crate::motion3d::kernels::{depths, equations};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::options::{MotionOptions, Smoother};
use crate::motion3d::model::result::Alternative;
use crate::motion3d::model::rows::tangents;
use rayon::prelude::*;

/// Minima that are then refined on all points, beside the one with the smoothest depths and the first where
/// signs count without their noise.
const FINALISTS: usize = 2;

/// Directions nearer than this, degrees, are one minimum.
pub(crate) const SAME: f64 = 0.5;

/// A minimum of the likelihood with what speaks against it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Candidate {
    pub minimum: Minimum,
    /// `J`, the depths behind the camera and, where it was needed, the depth map's roughness; in squared
    /// units of noise.
    pub cost: f64,
    /// The same but for what noise alone leads behind the camera, where the roughness is in it; else
    /// infinite.
    pub fair: f64,
}

impl Candidate {
    /// With the sign that has fewer depths behind the camera.
    pub fn signed(observations: &Observations, minimum: &Minimum) -> Self {
        let reversed = minimum.reversed(observations);
        let better = if reversed.equations.behind < minimum.equations.behind { reversed } else { *minimum };
        // J is of the minimum in both signs; taken from one of them, so that a cut does not matter.
        Self { minimum: better, cost: reversed.equations.cost + better.equations.behind, fair: f64::INFINITY }
    }

    pub fn motion(&self) -> &Motion {
        &self.minimum.motion
    }

    /// `J` and those depths behind the camera that noise does not lead there.
    fn without_noise(&self) -> f64 {
        self.minimum.equations.cost + self.minimum.equations.cheirality_cost()
    }
}

/// The minima of `J`, the cheapest first, with the best sign each.
pub(crate) fn minima(observations: &Observations, rng: CounterRng) -> Vec<Minimum> {
    let rounder = observations.rounder();
    let mut starts = starts(rounder.first().unwrap_or(observations), rng.stream(0));
    for points in &rounder {
        starts = refined(points, starts, rng).iter().map(|minimum| minimum.motion).collect();
    }
    refined(observations, starts, rng)
}

/// The minima that starts lead to.
fn refined(observations: &Observations, starts: Vec<Motion>, rng: CounterRng) -> Vec<Minimum> {
    let refined = if observations.n > MANY {
        let fewer = observations.subset(&sample(observations.n, FEWER, rng.stream(1)));
        let rough: Vec<Minimum> =
            starts.into_par_iter().map(|start| refine(&fewer, start, None, StoppingCriteria::ROUGH)).collect();
        let smoother = || DepthSmoother::new(&fewer, Smoother::Auto, rng.stream(6));
        let rough = different(rough);
        let mut finalists: Vec<Candidate> = rough.iter().map(|minimum| Candidate::signed(&fewer, minimum)).collect();
        finalists.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        let fairest = finalists.iter().min_by(|a, b| a.without_noise().total_cmp(&b.without_noise())).copied();
        finalists.truncate(FINALISTS);
        // The truth may be neither of those whose residuals happen to be small.
        let smoothest = choose(&fewer, &rough, smoother).0.into_iter().next();
        for added in [smoothest, fairest].into_iter().flatten() {
            if finalists.iter().all(|known| known.motion() != added.motion()) {
                finalists.push(added);
            }
        }
        // What leaves more on few points than chance explains need not be followed on many, regardless of its
        // signs and depths. (Signs do not decide here: at a minimum that is not reached yet they are of other
        // depths.)
        let left = |finalist: &Candidate| finalist.minimum.equations.cost;
        let least = finalists.iter().map(left).fold(f64::INFINITY, f64::min);
        let limit = least + cost_tolerance(fewer.n) * (least / fewer.n as f64).max(1.0);
        finalists.retain(|finalist| left(finalist) <= limit);
        let followed = |candidate: &Candidate| {
            refine(observations, *candidate.motion(), None, StoppingCriteria::of(observations.n))
        };
        finalists.iter().map(followed).collect()
    } else {
        starts.into_par_iter().map(|start| refine(observations, start, None, StoppingCriteria::FULL)).collect()
    };
    different(refined)
}

/// Sorted by cost, each minimum once, of either sign.
pub(crate) fn different(mut minima: Vec<Minimum>) -> Vec<Minimum> {
    minima.retain(|minimum| minimum.equations.cost.is_finite());
    minima.sort_by(|a, b| a.equations.cost.total_cmp(&b.equations.cost));
    let limit = SAME.to_radians().cos();
    let mut kept: Vec<Minimum> = Vec::with_capacity(minima.len());
    for minimum in minima {
        if kept.iter().all(|other| other.motion.u().dot(&minimum.motion.u()).abs() < limit) {
            kept.push(minimum);
        }
    }
    kept
}

/// By how much the costs of two minima of `n` points may differ by chance.
pub(crate) fn cost_tolerance(n: usize) -> f64 {
    8.0 * (n as f64).sqrt() + 25.0
}

/// The minima in the order of preference: by `J` and depth signs; where others come close, by the smoothness
/// of their depths, too.
///
/// `J` alone is a coin toss between two minima: their residuals use different components of the noise, and
/// differ by about `2 sqrt(n)` by chance.
pub(crate) fn choose(
    observations: &Observations,
    minima: &[Minimum],
    smoother: impl FnOnce() -> DepthSmoother,
) -> (Vec<Candidate>, Option<DepthSmoother>) {
    let mut candidates: Vec<Candidate> =
        minima.iter().map(|minimum| Candidate::signed(observations, minimum)).collect();
    candidates.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let Some(best) = candidates.first().map(|candidate| candidate.cost) else { return (candidates, None) };
    let least = candidates.iter().map(Candidate::without_noise).fold(f64::INFINITY, f64::min);
    let rival = |candidate: &Candidate| {
        candidate.cost < best + cost_tolerance(observations.n)
            || candidate.without_noise() < least + cost_tolerance(observations.n)
    };
    let (mut rivals, others): (Vec<Candidate>, Vec<Candidate>) = candidates.iter().partition(|one| rival(one));
    if rivals.len() < 2 {
        return (candidates, None);
    }
    let smoother = smoother();
    for candidate in &mut rivals {
        let rough = smoother.cost(&depths(observations, &candidate.minimum.motion));
        candidate.fair = candidate.without_noise() + rough;
        candidate.cost += rough;
    }
    rivals.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    rivals.extend(others);
    (rivals, Some(smoother))
}

/// Most minima from which smoothed weights are tried.
pub(crate) const TRIED: usize = 3;

/// Two solutions whose costs, which fluctuate by about `2 sqrt(n)`, differ by less than this times `sqrt(n)`
/// are as likely.
pub(crate) const UNDECIDED: f64 = 1.5;

/// Solutions nearer than so many standard deviations are one.
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
    let starts = near_best(candidates, inliers.n);
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
pub(crate) fn undecided(found: &[Efficient], costs: &[f64], best: usize, n: usize) -> Option<Alternative> {
    let deviation = DISTINCT * direction_deviation(&found[best].covariance);
    let other = |k: &usize| found[best].motion.angle_to(&found[*k].motion).to_degrees() > deviation;
    let next = (0..found.len()).filter(other).min_by(|&a, &b| costs[a].total_cmp(&costs[b]))?;
    let excess = costs[next] - costs[best];
    (excess < UNDECIDED * (n as f64).sqrt()).then_some(Alternative { motion: found[next].motion, excess })
}

/// `J`, the depths behind the camera and the depth map's roughness.
pub(crate) fn cost_of(observations: &Observations, smoother: &DepthSmoother, motion: &Motion) -> f64 {
    let at = equations(observations, motion, &tangents(&motion.u()), None);
    at.cost + at.behind + smoother.cost(&depths(observations, motion))
}

/// The chosen minimum and those that come close to it.
pub(crate) fn near_best(candidates: &[Candidate], n: usize) -> &[Candidate] {
    let limit = candidates[0].cost + cost_tolerance(n);
    let count = candidates.iter().take_while(|other| other.cost < limit).count();
    &candidates[..count.max(1)]
}
