//! Maximum likelihood over all motions, and which of several minima it was.

use super::covariance::direction_deviation;
use super::depth_smoother;
use super::efficient::{Efficient, WeightDepths, efficient};
use super::refine::{FEWER, MANY, Minimum, StoppingCriteria, refine};
use super::starts::starts;
use crate::math::{random::CounterRng, tangents};
use crate::motion3d::kernels::{depths, equations};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::options::MotionOptions;
use crate::motion3d::model::result::Alternative;
use crate::parallel;
use crate::scattered::{SiteSmoother, Smoother};

/// Most minima of few points that are followed on all, and from which smoothed weights are tried.
const FINALISTS: usize = 3;

/// Solutions nearer than so many standard deviations are one.
pub(crate) const DISTINCT: f64 = 3.0;

/// Directions nearer than this, degrees, are one minimum.
pub(crate) const SAME: f64 = 0.5;

/// A minimum of the likelihood with what speaks against it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Candidate {
    pub minimum: Minimum,
    /// `J`, the depths behind the camera and, where it was needed, the depth map's roughness; in squared
    /// units of noise.
    pub cost: f64,
}

impl Candidate {
    /// With the sign that has fewer depths behind the camera.
    pub fn signed(observations: &Observations, minimum: &Minimum) -> Self {
        let reversed = minimum.reversed(observations);
        let better = if reversed.equations.behind < minimum.equations.behind { reversed } else { *minimum };
        // J is of the minimum in both signs; taken from one of them, so that a cut does not matter.
        Self { minimum: better, cost: reversed.equations.cost + better.equations.cheirality_cost() }
    }

    pub fn motion(&self) -> &Motion {
        &self.minimum.motion
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
        let fewer = observations.subset(&rng.stream(1).sample(observations.n, FEWER));
        let rough: Vec<Minimum> = parallel::map(starts, |start| refine(&fewer, start, StoppingCriteria::ROUGH));
        let smoother = || depth_smoother(&fewer, Smoother::Auto, rng.stream(6));
        let mut finalists = choose(&fewer, &different(rough), smoother).0;
        finalists.truncate(FINALISTS);
        let followed =
            |candidate: &Candidate| refine(observations, *candidate.motion(), StoppingCriteria::of(observations.n));
        finalists.iter().map(followed).collect()
    } else {
        parallel::map(starts, |start| refine(observations, start, StoppingCriteria::FULL))
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
fn cost_tolerance(n: usize) -> f64 {
    8.0 * (n as f64).sqrt() + 25.0
}

/// The minima in the order of preference: by `J` and depth signs, and where others come close by the
/// smoothness of their depths, too, as the `J` of two minima differ by about `2 sqrt(n)` by chance.
pub(crate) fn choose(
    observations: &Observations,
    minima: &[Minimum],
    smoother: impl FnOnce() -> SiteSmoother,
) -> (Vec<Candidate>, Option<SiteSmoother>) {
    let mut candidates: Vec<Candidate> =
        minima.iter().map(|minimum| Candidate::signed(observations, minimum)).collect();
    candidates.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let Some(best) = candidates.first().map(|candidate| candidate.cost) else { return (candidates, None) };
    let rival = |candidate: &Candidate| candidate.cost < best + cost_tolerance(observations.n);
    let (mut rivals, others): (Vec<Candidate>, Vec<Candidate>) = candidates.iter().partition(|one| rival(one));
    if rivals.len() < 2 {
        return (candidates, None);
    }
    let smoother = smoother();
    for candidate in &mut rivals {
        candidate.cost += smoother.cost(depths(observations, &candidate.minimum.motion).measured());
    }
    rivals.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    rivals.extend(others);
    (rivals, Some(smoother))
}

/// Two solutions whose costs, which fluctuate by about `2 sqrt(n)`, differ by less than this times `sqrt(n)`
/// are as likely.
const UNDECIDED: f64 = 1.5;

/// The likeliest solution of the smoothed weights from any of the minima, and another that is about as
/// likely. A spurious minimum, whose epipole sits among noisy points, may lead nowhere.
pub(crate) fn smoothed(
    inliers: &Observations,
    options: &MotionOptions,
    candidates: &[Candidate],
    smoother: &mut SiteSmoother,
) -> Option<(Efficient, Option<Alternative>)> {
    let mut starts = near_best(candidates, inliers.n).iter().take(FINALISTS);
    if let Some(depths) = &options.weight_depths {
        let mut nu: Vec<f64> = inliers.source.iter().map(|&k| depths[k as usize]).collect();
        nu.resize(inliers.stride, 0.0);
        let known = |start: &Candidate| efficient(inliers, start.motion(), WeightDepths::Known(nu.clone()));
        return starts.find_map(known).map(|best| (best, None));
    }
    let found: Vec<Efficient> =
        starts.filter_map(|start| efficient(inliers, start.motion(), WeightDepths::Smoothed(smoother))).collect();
    let mut found: Vec<(f64, Efficient)> =
        found.into_iter().map(|found| (cost_of(inliers, smoother, &found.motion), found)).collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut found = found.into_iter();
    let (least, best) = found.next()?;
    let same = DISTINCT * direction_deviation(&best.covariance);
    let other = found.find(|(_, other)| best.motion.angle_to(&other.motion).to_degrees() > same);
    let other = other.map(|(cost, other)| Alternative { motion: other.motion, excess: cost - least });
    let undecided = other.filter(|other| other.excess < UNDECIDED * (inliers.n as f64).sqrt());
    Some((best, undecided))
}

/// `J`, the depths behind the camera and the depth map's roughness.
pub(crate) fn cost_of(observations: &Observations, smoother: &SiteSmoother, motion: &Motion) -> f64 {
    let at = equations(observations, motion, &tangents(&motion.u()), None);
    at.cost + at.cheirality_cost() + smoother.cost(depths(observations, motion).measured())
}

/// The chosen minimum and those that come close to it.
pub(crate) fn near_best(candidates: &[Candidate], n: usize) -> &[Candidate] {
    let limit = candidates[0].cost + cost_tolerance(n);
    let count = candidates.iter().take_while(|other| other.cost < limit).count();
    &candidates[..count.max(1)]
}
