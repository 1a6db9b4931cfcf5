//! Entry point: estimates rigid motion from optical flow. Searches the inliers where it must, fits the motion
//! to them and assembles the result.

use super::diagnostics::report::{doubted, of_estimated_noise, report, rotation_report};
use super::diagnostics::rotation::{
    explained_by_rotation, explained_by_rotation_in_unknown_noise, without_likeliest_rotation,
};
use super::diagnostics::solution::Solution;
use super::diagnostics::status::judge;
use super::model::input::{Flow, Noise};
use super::model::observations::{Observations, Scaled, UNKNOWNS};
use super::model::options::{Method, MotionOptions, RotationPrior};
use super::model::result::{Alternative, MotionEstimate, Status};
use super::model::whitening::Whitening;
use super::robust;
use super::robust::{Consensus, larger};
use super::solver::covariance::plugged;
use super::solver::depth_smoother;
use super::solver::efficient::{beyond_theory, covariance_at};
use super::solver::finite_rotation::{settle, shift};
use super::solver::likelihood::{Candidate, choose, minima, near_best, smoothed};
use super::solver::profile_likelihood::ProfileLikelihood;
use super::solver::refine::{Minimum, StoppingCriteria, refine};
use crate::ablation::keeps;
use crate::error::Result;
use crate::math::{by_chance, random::CounterRng};
use crate::scattered::SiteSmoother;

/// Mean square of residuals in the noise given, beyond which a motion does not explain the flow.
const MISFIT: f64 = 9.0;

/// The rigid motion that explains a flow field, with covariance and depths.
///
/// Maximum likelihood by a search over all directions, then the estimating equation with smoothed weights
/// (see the module). Units: with a camera flow is in px/frame and `noise_std` in px. Rows that are not finite
/// are left out and come back as NaN. Degenerate scenes are reported in [`MotionEstimate::status`], not as
/// errors. Everything is computed in double precision.
///
/// # Errors
/// [`Argument`](crate::error::Error::Argument) naming what has the wrong length or value: `flow`,
/// `noise_std`, `cov`, `points`, `weight_inv_depth`, `rotation_prior`, `initial`,
/// `points_per_independent_sample`, `correlation_length`.
pub fn estimate_motion(flow: &Flow<'_>, noise: &Noise<'_>, options: &MotionOptions) -> Result<MotionEstimate> {
    flow.check(noise)?;
    options.check(flow, noise)?;
    Ok(options.threads.check()?.install(|| estimate(flow, noise, options)))
}

fn estimate(flow: &Flow<'_>, noise: &Noise<'_>, options: &MotionOptions) -> MotionEstimate {
    let noise_std = if let Noise::StandardDeviation(noise_std) = noise { *noise_std } else { 1.0 };
    let whitening = Whitening::new(flow, noise, options.placement);
    let unknown = matches!(noise, Noise::Unknown);
    let mut scaled = Scaled { observations: whitening.whitened(), noise_std, unknown, may_turn: true };
    if let Some(depths) = &options.weight_depths {
        let known = |k: &u32| depths[scaled.observations.source[*k as usize] as usize].is_finite();
        let chosen: Vec<u32> = (0..scaled.observations.n as u32).filter(known).collect();
        scaled.observations = scaled.observations.subset(&chosen);
    }
    if scaled.observations.n < UNKNOWNS {
        let noise_std = if scaled.unknown { f64::NAN } else { noise_std };
        return MotionEstimate::nothing(flow.len(), Status::TooFewPoints, noise_std);
    }
    scaled.observations.points_per_independent_sample = options.points_per_independent_sample.unwrap_or(1.0);
    let alone = |given: Option<f64>, usual: f64| given.is_none_or(|given| given == usual);
    scaled.observations.independent =
        alone(options.points_per_independent_sample, 1.0) && alone(options.correlation_length, 0.0);
    if unknown && options.rotation_prior.is_some() {
        // What is known beforehand weighs nothing beside flow of no noise, and it does not determine how
        // large that is.
        let alone = estimate(flow, noise, &MotionOptions { rotation_prior: None, ..options.clone() });
        scaled.take(alone.noise_std);
        scaled.may_turn = alone.status == Status::RotationOnly;
    }
    scaled.observations.prior = options.rotation_prior.as_ref().and_then(RotationPrior::information);
    let rng = CounterRng::new(options.random_state);
    // What is left of the flow without the rotation that explains most of it is short: a search that knows
    // nothing of the motion then sees nearly exact flow.
    if !options.robust
        && let Some(turned) = without_likeliest_rotation(&whitening, &scaled.observations)
    {
        scaled.observations = turned;
    }
    let still = match (options.robust, scaled.unknown) {
        // Nothing is left that noise could be estimated from, but for rounding.
        (true, true) => explained_by_rotation_in_unknown_noise(&scaled.observations, 0.0).map(|rotation| {
            rotation.in_units(scaled.take((rotation.chi2 / (2 * scaled.observations.n - 3) as f64).sqrt()))
        }),
        (false, false) => explained_by_rotation(&scaled.observations),
        _ => None,
    };
    if let Some(rotation) = still {
        let all = &scaled.observations;
        return rotation_report(flow, all, all, &rotation, scaled.noise_std, options);
    }
    if !options.robust {
        let inliers = scaled.observations.clone();
        let found = Task { whitening: &whitening, options, known: None, rng }.on(&mut scaled, inliers);
        return explained(flow, noise, options, found);
    }
    let Some(kept) = consensus(&whitening, &mut scaled, rng.stream(1)) else {
        return MotionEstimate::nothing(flow.len(), Status::IllConditioned, scaled.noise_std);
    };
    let inliers = scaled.observations.subset(&kept.inliers);
    let found = Task { whitening: &whitening, options, known: Some(&kept), rng }.on(&mut scaled, inliers);
    doubted(found, &scaled.observations, &kept)
}

/// The inliers of one motion, judged by their own errors.
fn consensus(whitening: &Whitening<'_>, scaled: &mut Scaled, rng: CounterRng) -> Option<Consensus> {
    let own = scaled.observations.own();
    scaled.observations.rescale(1.0 / own);
    let mut found = robust::consensus(whitening, scaled, rng);
    scaled.observations.rescale(own);
    for competitor in found.iter_mut().flat_map(|found| &mut found.competing) {
        competitor.excess *= own * own;
    }
    found
}

/// Number of points from which on [`Method::Auto`] smooths depths.
const SMOOTHED: usize = 30;

/// Squared shift, in standard deviations, by which a motion differs from that whose rotation is taken out.
const MAX_SHIFT: f64 = 1.0;

/// The inliers of one motion with the options of the fit.
struct Task<'a, 'b> {
    whitening: &'a Whitening<'b>,
    options: &'a MotionOptions,
    /// What a robust search found.
    known: Option<&'a Consensus>,
    rng: CounterRng,
}

/// `found`, or where it does not explain the flow in the noise given, what a search by minimal samples leads
/// to if that explains more of it: nearly exact displacements have narrow minima.
fn explained(flow: &Flow<'_>, noise: &Noise<'_>, options: &MotionOptions, found: MotionEstimate) -> MotionEstimate {
    let misfit = |found: &MotionEstimate| {
        let known: Vec<f64> = found.residuals.iter().copied().filter(|rest| rest.is_finite()).collect();
        known.iter().map(|rest| rest * rest).sum::<f64>() / known.len().max(1) as f64
    };
    let is_settled = matches!(noise, Noise::Unknown) || options.initial.is_some() || misfit(&found) < MISFIT;
    if is_settled || !keeps("motion3d.sampled_start") {
        return found;
    }
    let sampled = estimate(flow, noise, &MotionOptions { robust: true, ..options.clone() });
    if !sampled.motion.translation[0].is_finite() {
        return found;
    }
    let again = estimate(flow, noise, &MotionOptions { initial: Some(sampled.motion), ..options.clone() });
    if misfit(&again) < misfit(&found) { again } else { found }
}

impl Task<'_, '_> {
    /// Estimates on the `inliers` of all points.
    fn on(&self, scaled: &mut Scaled, mut inliers: Observations) -> MotionEstimate {
        let flow = self.whitening.flow;
        let mut found = self.begin(&inliers);
        settle(self.whitening, &mut inliers, &mut found);
        if found.is_empty() {
            return MotionEstimate::nothing(flow.len(), Status::IllConditioned, scaled.noise_std);
        }
        let cost = found[0].equations.cost - inliers.pulled(&found[0].motion.w());
        if let Some(turn) = inliers.turn {
            scaled.observations = self.whitening.derotated(&scaled.observations, turn);
        }
        if let Some(estimate) = self.without_translation(scaled, &mut inliers, cost) {
            return estimate;
        }
        if scaled.unknown {
            inliers.rescale(scaled.take((cost / inliers.n.saturating_sub(UNKNOWNS).max(1) as f64).sqrt()));
            found =
                found.iter().map(|minimum| refine(&inliers, minimum.motion, StoppingCriteria::of(inliers.n))).collect();
        }
        let (candidates, made) = self.chosen(&inliers, &found);
        let mut solution = self.solved(&inliers, &candidates, made);
        // Undetermined: the points were derotated about a different rotation.
        solution.described &= shift(self.whitening, &inliers, &solution.motion) <= MAX_SHIFT;
        self.inflate(&mut solution, scaled, &inliers, candidates[0].minimum.equations.cost);
        solution.alternatives = near_best(&candidates, inliers.n)[1..]
            .iter()
            .map(|other| Alternative { motion: *other.motion(), excess: other.cost - candidates[0].cost })
            .collect();
        let competing: &[Alternative] = self.known.map_or(&[], |known| &known.competing);
        judge(self.whitening, &inliers, &mut solution, scaled.unknown, competing, self.rng.stream(4));
        report(flow, &scaled.observations, &inliers, &solution, scaled.noise_std)
    }

    /// The minima of the likelihood.
    fn begin(&self, inliers: &Observations) -> Vec<Minimum> {
        match (&self.options.initial, self.known) {
            (Some(initial), _) => vec![refine(inliers, initial.normalized(), StoppingCriteria::FULL)],
            (None, None) => minima(inliers, self.rng.stream(2)),
            // Among many outliers that motion is already the likeliest.
            (None, Some(known)) if known.many => vec![refine(inliers, known.motion, StoppingCriteria::NONE)],
            (None, Some(known)) => vec![refine(inliers, known.motion, StoppingCriteria::of(inliers.n))],
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
        let rotation = match (scaled.may_turn, scaled.unknown) {
            (true, true) => {
                let rotation = explained_by_rotation_in_unknown_noise(inliers, cost)?;
                let left = rotation.chi2 - inliers.pulled(&rotation.rotation);
                let factor = scaled.take((left / (2 * inliers.n - 3) as f64).sqrt());
                inliers.rescale(factor);
                rotation.in_units(factor)
            }
            (true, false) if self.options.robust => explained_by_rotation(inliers)?,
            _ => return None,
        };
        let (flow, all) = (self.whitening.flow, &scaled.observations);
        Some(rotation_report(flow, all, inliers, &rotation, scaled.noise_std, self.options))
    }

    /// The minima in the order of preference.
    fn chosen(&self, inliers: &Observations, found: &[Minimum]) -> (Vec<Candidate>, Option<SiteSmoother>) {
        if self.options.initial.is_some() {
            let given = |minimum: &Minimum| Candidate { cost: minimum.equations.cost, minimum: *minimum };
            return (found.iter().map(given).collect(), None);
        }
        choose(inliers, found, || self.smoother(inliers))
    }

    fn smoother(&self, inliers: &Observations) -> SiteSmoother {
        depth_smoother(inliers, self.options.smoother, self.rng.stream(3))
    }

    /// Maximum likelihood's motion or that of the smoothed weights, which are also solved where maximum
    /// likelihood's theory does not hold.
    fn solved(&self, inliers: &Observations, candidates: &[Candidate], made: Option<SiteSmoother>) -> Solution {
        let chosen = &candidates[0];
        let wanted = match self.options.method {
            Method::Auto => inliers.n >= SMOOTHED,
            Method::Efficient => true,
            Method::MaximumLikelihood => false,
        };
        let plugged = plugged(&chosen.minimum.equations.h, &chosen.minimum.equations.p);
        let Minimum { motion, tangent, .. } = &chosen.minimum;
        let profile = ProfileLikelihood { observations: inliers, motion, tangent };
        let bent = plugged.as_ref().is_some_and(|plugged| profile.bent(&plugged.likelihood) > 0);
        let linear = plugged.as_ref().is_some_and(|plugged| !bent && !beyond_theory(inliers, &chosen.minimum, plugged));
        let mut tried = None;
        if wanted || !linear {
            let mut smoother = made.unwrap_or_else(|| self.smoother(inliers));
            tried = smoothed(inliers, self.options, candidates, &mut smoother);
        }
        let (mut improved, undecided) = tried.unzip();
        // Maximum likelihood alone is undetermined beyond its theory; a minimum from where smoothed weights
        // lead nowhere is spurious.
        let mut described = !bent && !wanted;
        if let Some(best) = &mut improved {
            (best.covariance, described) = best.lengthened(inliers, || self.smoother(inliers));
        }
        let undescribed = plugged.is_none() && improved.is_none();
        let mut solution = Solution::new(chosen.minimum, plugged, improved, wanted);
        (solution.described, solution.undecided) = (described, undecided.flatten());
        if undescribed {
            solution.covariance = covariance_at(inliers, &solution.motion, &mut self.smoother(inliers));
        }
        solution
    }

    /// Takes into account what a linear theory of independent inliers of known noise leaves out. `cost`: what
    /// maximum likelihood leaves.
    fn inflate(&self, solution: &mut Solution, scaled: &Scaled, inliers: &Observations, cost: f64) {
        if let Some(known) = self.known {
            solution.weighted_by_posterior(&scaled.observations, known, self.options.weight_depths.is_some());
        }
        let wider = match (scaled.unknown, self.known) {
            (true, known) => {
                let Some(wider) = of_estimated_noise(inliers.n, known.is_some()) else {
                    (solution.covariance, solution.plugged) = (None, None);
                    return;
                };
                wider
            }
            // The residuals determine how large correlated errors are.
            (false, _) if self.options.correlation().is_some() => 1.0,
            (false, None) => misfit(inliers, cost),
            // What outliers leave among truncated residuals is accounted for.
            (false, Some(_)) => larger(&scaled.observations, &solution.motion),
        };
        solution.inflate(inliers, self.whitening.flow, self.options, wider);
    }
}

/// What residuals are larger by, in variance, than the given noise, where chance does not explain it: what
/// the model leaves out (larger noise than given, outliers, a minimum that was missed), the motion is off by
/// as much (R. Birge 1932).
fn misfit(inliers: &Observations, cost: f64) -> f64 {
    let free = inliers.n.saturating_sub(UNKNOWNS) as f64 / inliers.points_per_independent_sample;
    if free > 0.0 && !by_chance(cost, free) { cost / free } else { 1.0 }
}
