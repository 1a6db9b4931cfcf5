//! Fits the motion to the inliers and assembles the result.

use super::diagnostics::report::{of_estimated_noise, report, rotation_report};
use super::diagnostics::rotation_only::{explained_by_rotation, explained_by_rotation_in_unknown_noise};
use super::diagnostics::rotation_prior::of_flow_alone;
use super::diagnostics::solution::Solution;
use super::diagnostics::status::{Evidence, judge};
use super::model::motion::Motion;
use super::model::observations::{Observations, Scaled};
use super::model::options::{Method, MotionOptions};
use super::model::result::{Alternative, MotionEstimate, Status};
use super::model::whitening::Whitening;
use super::robust::{CompetingMotion, Consensus, larger};
use super::solver::covariance::{PluginCovariances, direction_deviation, plugged};
use super::solver::efficient::{Efficient, beyond_theory, covariance_at};
use super::solver::finite_rotation::{matters, settle, shift};
use super::solver::likelihood::{Candidate, DISTINCT, Trial, choose, different, minima, near_best, smoothed};
use super::solver::profile_likelihood::ProfileLikelihood;
use super::solver::refine::{Minimum, StoppingCriteria, refine};
use super::solver::smoothing::DepthSmoother;
use crate::math::by_chance;
use crate::math::random::CounterRng;
use rayon::prelude::*;

/// Number of points from which on [`Method::Auto`] smooths depths.
const SMOOTHED: usize = 30;

/// Squared shift, in standard deviations, by which a motion differs from that whose rotation is taken out.
const MAX_SHIFT: f64 = 1.0;

/// The inliers of one motion with the options of the fit.
pub(crate) struct Task<'a, 'b> {
    pub whitening: &'a Whitening<'b>,
    pub options: &'a MotionOptions,
    /// What a robust search found.
    pub known: Option<&'a Consensus>,
    pub rng: CounterRng,
}

/// A motion with what speaks for and against it.
struct Solved {
    solution: Solution,
    /// Standard deviation of maximum likelihood's direction, degrees; 0 where it is not known.
    deviation: f64,
    low: bool,
    /// Whether the covariance describes the shape of the confidence region.
    described: bool,
    undecided: Option<Alternative>,
}

impl Task<'_, '_> {
    /// Estimates on the `inliers` of all points.
    pub fn on(&self, scaled: &mut Scaled, mut inliers: Observations) -> MotionEstimate {
        let flow = self.whitening.flow;
        let mut found = self.begin(&inliers);
        let Some(&first) = found.first() else {
            return MotionEstimate::nothing(flow.len(), Status::IllConditioned, scaled.noise_std);
        };
        settle(self.whitening, &mut scaled.observations, &mut inliers, &mut found, &first, scaled.unknown);
        let cost = found[0].equations.cost - inliers.pulled(&found[0].motion.w());
        if let Some(estimate) = self.without_translation(scaled, &mut inliers, cost) {
            return estimate;
        }
        if scaled.unknown {
            let noise_std = (cost / inliers.n.saturating_sub(5).max(1) as f64).sqrt();
            rescaled(scaled, &mut inliers, noise_std);
            found = found
                .iter()
                .map(|minimum| refine(&inliers, minimum.motion, None, StoppingCriteria::of(inliers.n)))
                .collect();
        }
        let (candidates, made) = self.chosen(&inliers, &found);
        let mut solved = self.solved(&inliers, &candidates, made);
        // Undetermined: the points were derotated about a different rotation.
        solved.described &= shift(self.whitening, &inliers, &solved.solution.motion) <= MAX_SHIFT;
        self.inflate(&mut solved.solution, scaled, &inliers, candidates[0].minimum.equations.cost);
        solved.undecided = solved.undecided.or_else(|| contested(&candidates, &solved.solution));
        if solved.solution.contradicted(&inliers) {
            solved.undecided = Some(of_flow_alone(&inliers, &solved.solution.motion));
        }
        solved.solution.alternatives = near_best(&candidates, inliers.n)[1..]
            .iter()
            .map(|other| Alternative { motion: *other.motion(), excess: other.cost - candidates[0].cost })
            .collect();
        let competing: &[CompetingMotion] = self.known.map_or(&[], |known| &known.competing);
        let Solved { mut solution, deviation, low, described, undecided } = solved;
        let likelihood = (*candidates[0].motion(), candidates[0].minimum.equations.behind);
        let unknown = scaled.unknown;
        let evidence = Evidence { likelihood, deviation, low, described, unknown, competing, undecided };
        judge(self.whitening, &inliers, &mut solution, &evidence, self.rng.stream(4));
        report(flow, &scaled.observations, &inliers, &solution, scaled.noise_std)
    }

    /// The minima of the likelihood.
    fn begin(&self, inliers: &Observations) -> Vec<Minimum> {
        match (&self.options.initial, self.known) {
            (Some(initial), _) => {
                let initial = Motion::new(initial.translation, initial.rotation);
                vec![refine(inliers, initial, None, StoppingCriteria::FULL)]
            }
            (None, None) => minima(inliers, self.rng.stream(2)),
            (None, Some(known)) => again(inliers, known),
        }
    }

    /// The report where chance explains what a rotation alone leaves; `cost` is what the best motion leaves
    /// of the flow. (Of all points in known noise this was tested before any motion was searched.)
    fn without_translation(
        &self,
        scaled: &mut Scaled,
        inliers: &mut Observations,
        cost: f64,
    ) -> Option<MotionEstimate> {
        let rotation = if !scaled.may_turn {
            return None;
        } else if scaled.unknown {
            let rotation = explained_by_rotation_in_unknown_noise(inliers, cost)?;
            let left = rotation.chi2 - inliers.pulled(&rotation.rotation);
            let noise_std = (left / (2 * inliers.n - 3) as f64).sqrt();
            rotation.in_units(rescaled(scaled, inliers, noise_std))
        } else if self.options.robust {
            explained_by_rotation(inliers)?
        } else {
            return None;
        };
        Some(rotation_report(
            self.whitening.flow,
            &scaled.observations,
            inliers,
            &rotation,
            scaled.noise_std,
            self.options,
        ))
    }

    /// The minima in the order of preference; the first has its own rotation taken out of the points if any
    /// has.
    fn chosen(&self, inliers: &Observations, found: &[Minimum]) -> (Vec<Candidate>, Option<DepthSmoother>) {
        let (mut candidates, made) = self.preferred(inliers, found);
        if let Some(own) = candidates.iter().position(|other| !matters(self.whitening, inliers, other.motion())) {
            candidates[..=own].rotate_right(1);
        }
        (candidates, made)
    }

    fn preferred(&self, inliers: &Observations, found: &[Minimum]) -> (Vec<Candidate>, Option<DepthSmoother>) {
        if self.options.initial.is_some() {
            let given =
                |minimum: &Minimum| Candidate { cost: minimum.equations.cost, fair: f64::INFINITY, minimum: *minimum };
            return (found.iter().map(given).collect(), None);
        }
        choose(inliers, found, || self.smoother(inliers))
    }

    fn smoother(&self, inliers: &Observations) -> DepthSmoother {
        DepthSmoother::new(inliers, self.options.smoother, self.rng.stream(3))
    }

    /// Maximum likelihood's motion or that of the smoothed weights, which are also solved where maximum
    /// likelihood's theory does not hold.
    fn solved(&self, inliers: &Observations, candidates: &[Candidate], made: Option<DepthSmoother>) -> Solved {
        let chosen = candidates[0];
        let wanted = match self.options.method {
            Method::Auto => inliers.n >= SMOOTHED,
            Method::Efficient => true,
            Method::MaximumLikelihood => false,
        };
        let plugged = plugged(&chosen.minimum.equations.h, &chosen.minimum.equations.p);
        let low = plugged.is_none();
        let several = near_best(candidates, inliers.n).len() > 1;
        let Minimum { motion, tangent, .. } = &chosen.minimum;
        let profile = ProfileLikelihood { observations: inliers, motion, tangent };
        let beyond = |plugged: &PluginCovariances| {
            beyond_theory(inliers, &chosen.minimum, plugged) || profile.bent(&plugged.likelihood) > 0
        };
        let nonlinear = plugged.as_ref().is_some_and(beyond);
        let trial = if wanted || low || several || nonlinear {
            smoothed(inliers, self.options, candidates, made, || self.smoother(inliers))
        } else {
            None
        };
        let (improved, mut undecided) = trial.map_or((None, None), |Trial { best, undecided }| (Some(best), undecided));
        if let Some(best) = improved.as_ref().filter(|_| !wanted) {
            undecided = preferred_to(best, &chosen, plugged.as_ref()).or(undecided);
        }
        let mut improved = improved.filter(|_| wanted || low || nonlinear);
        // Maximum likelihood alone is undetermined beyond its theory.
        let mut described = plugged.as_ref().is_none_or(|plugged| profile.bent(&plugged.likelihood) == 0);
        if let Some(best) = &mut improved {
            (best.covariance, described) = best.lengthened(inliers, || self.smoother(inliers));
        }
        // From where they lead nowhere the minimum is a spurious one.
        described &= improved.is_some() || !wanted;
        let unknown = low && improved.is_none();
        let mut solution = Solution::new(&chosen, plugged.as_ref(), improved, wanted);
        if unknown {
            solution.covariance = covariance_at(inliers, &solution.motion, &mut self.smoother(inliers));
        }
        let deviation = plugged.as_ref().map_or(0.0, |plugged| direction_deviation(&plugged.likelihood));
        Solved { solution, deviation, low, described, undecided }
    }

    /// Takes into account what a linear theory of independent inliers of known noise leaves out. `cost`: what
    /// maximum likelihood leaves.
    fn inflate(&self, solution: &mut Solution, scaled: &Scaled, inliers: &Observations, cost: f64) {
        if let Some(known) = self.known {
            solution.weighted_by_posterior(&scaled.observations, known, self.options.weight_depths.is_some());
        }
        let common = solution.systematic_effect(inliers, self.whitening.flow, &self.options.systematic_errors());
        let length = self.options.correlation_length.filter(|length| *length > 0.0);
        solution.add_correlation(inliers, self.whitening.flow, length);
        let wider = match (scaled.unknown, self.known) {
            (true, known) => of_estimated_noise(inliers.n, known.is_some()),
            // The residuals determine how large correlated errors are.
            (false, _) if length.is_some() => 1.0,
            (false, None) => misfit(inliers, cost),
            // What outliers leave among truncated residuals is accounted for.
            (false, Some(_)) => larger(&scaled.observations, &solution.motion),
        };
        solution.inflate(wider, common);
    }
}

/// Another minimum that is preferred with the rotation taken out that belongs to the first, as that is with
/// its own; or one that is where depths behind the camera count only where noise does not explain them: of
/// depths near 0, half are behind it.
fn contested(candidates: &[Candidate], solution: &Solution) -> Option<Alternative> {
    let first = &candidates[0];
    let preferred = candidates.get(1).filter(|other| other.cost < first.cost);
    let deviation = DISTINCT * solution.covariance.as_ref().map_or(0.0, direction_deviation);
    let apart = |other: &&Candidate| other.motion().angle_to(&solution.motion).to_degrees() > deviation;
    let fairer = || candidates.iter().filter(|other| other.fair < first.fair).filter(apart);
    let other = preferred.or_else(|| fairer().min_by(|a, b| a.fair.total_cmp(&b.fair)))?;
    Some(Alternative { motion: *other.motion(), excess: other.cost - first.cost })
}

/// What residuals are larger by, in variance, than the given noise, where chance does not explain it: what
/// the model leaves out (larger noise than given, outliers, a minimum that was missed), the motion is off by
/// as much (R. Birge 1932).
fn misfit(inliers: &Observations, cost: f64) -> f64 {
    let free = inliers.n.saturating_sub(5) as f64 / inliers.points_per_independent_sample;
    if free > 0.0 && !by_chance(cost, free) { cost / free } else { 1.0 }
}

/// The smoothed weights' solution where it is not the minimum that maximum likelihood chose: then either may
/// be true.
fn preferred_to(best: &Efficient, chosen: &Candidate, plugged: Option<&PluginCovariances>) -> Option<Alternative> {
    let deviation = plugged.map_or(0.0, |plugged| direction_deviation(&plugged.likelihood));
    let deviation = deviation.max(direction_deviation(&best.covariance));
    let apart = best.motion.angle_to(chosen.motion()).to_degrees() > DISTINCT * deviation;
    apart.then_some(Alternative { motion: best.motion, excess: 0.0 })
}

/// The minimum that a robust search led to, and those that other minima for the same points lead to.
///
/// Among many outliers that motion is already the likeliest.
fn again(inliers: &Observations, known: &Consensus) -> Vec<Minimum> {
    if known.many {
        return vec![refine(inliers, known.motion, None, StoppingCriteria::NONE)];
    }
    let others = known.competing.iter().filter(|competitor| !competitor.others).map(|competitor| competitor.motion);
    let motions: Vec<Motion> = std::iter::once(known.motion).chain(others).collect();
    different(
        motions.into_par_iter().map(|motion| refine(inliers, motion, None, StoppingCriteria::of(inliers.n))).collect(),
    )
}

/// Takes `noise_std` to be the noise of all points and of the inliers; returns what everything was multiplied
/// with.
fn rescaled(scaled: &mut Scaled, inliers: &mut Observations, noise_std: f64) -> f64 {
    let before = scaled.noise_std;
    scaled.take(noise_std);
    let factor = before / scaled.noise_std;
    inliers.rescale(factor);
    factor
}
