//! The whole way from flow to motion.

use super::covariance::{Plugged, direction_deviation, plugged};
use super::departure::beyond_theory;
use super::displaced::{beforehand, decides, matters, settle};
use super::efficient::{Efficient, WeightDepths, unsolved};
use super::intake::Intake;
use super::likelihood::{Candidate, choose, different, minima};
use super::motion::Motion;
use super::observations::{Known, Observations};
use super::options::{Flow, Method, MotionOptions, Noise};
use super::refine::{Effort, Minimum, refine};
use super::report::{Solution, report, rotation_report};
use super::result::{Alternative, MotionEstimate, Status};
use super::robust::{self, Consensus, Rival};
use super::selected::{doubted, of_estimated_noise, with_all_inliers};
use super::smoothing::DepthSmoother;
use super::special::{RotationOnly, by_chance, rotation_only};
use super::trial::{DISTINCT, Trial, close, smoothed};
use super::turned::HalfTurn;
use super::verdict::{Evidence, judge};
use crate::error::Result;
use crate::math::random::CounterRng;
use rayon::prelude::*;

/// Least number of points for a motion.
const LEAST: usize = 5;

/// Number of points from which on [`Method::Auto`] smooths depths.
const SMOOTHED: usize = 30;

/// Noise of flow that is exactly zero, in its unit.
const LEAST_NOISE: f64 = 1e-100;

/// Times that a rotation is taken out of displacements and points that obey are looked for again.
const TURNS: usize = 2;

/// Residuals below this share of the flow are rounding.
const ROUNDING: f64 = 1e-11;

/// The rigid motion that explains a flow field, with covariance and depths.
///
/// Maximum likelihood by a search over all directions, then the estimating equation with smoothed weights (see the module). Units: with a camera flow is in px/frame and `sigma` in px. Rows that are
/// not finite are left out and come back as NaN. Scenes that do not determine a motion are told by [`MotionEstimate::status`] and are no error. Everything is computed in double precision.
///
/// # Errors
/// [`Argument`](crate::error::Error::Argument) naming what has the wrong length or value: `flow`, `sigma`, `cov`, `points`, `weight_inv_depth`, `rotation_prior`, `initial`, `shared`, `correlation_length`.
pub fn estimate_motion(flow: &Flow<'_>, noise: &Noise<'_>, options: &MotionOptions) -> Result<MotionEstimate> {
    flow.check(noise)?;
    options.check(flow, noise)?;
    Ok(options.threads.check()?.install(|| estimate(flow, noise, options)))
}

/// Points in units of their noise, and that in the flow's unit.
pub(super) struct Scaled {
    pub observations: Observations,
    pub sigma: f64,
    /// Whether `sigma` has to be estimated.
    pub unknown: bool,
}

impl Scaled {
    /// Takes `sigma` in units of the present noise to be the noise.
    pub fn take(&mut self, sigma: f64) {
        let sigma = sigma.max(ROUNDING * self.observations.median_flow()).max(LEAST_NOISE);
        if sigma.is_finite() {
            self.observations.rescale(1.0 / sigma);
            self.sigma *= sigma;
        }
    }
}

fn estimate(flow: &Flow<'_>, noise: &Noise<'_>, options: &MotionOptions) -> MotionEstimate {
    let sigma = if let Noise::Sigma(sigma) = noise { *sigma } else { 1.0 };
    let intake = Intake::new(flow, noise, options.placement);
    let mut scaled = Scaled { observations: intake.whitened(), sigma, unknown: matches!(noise, Noise::Unknown) };
    if let Some(depths) = &options.weight_depths {
        let known = |k: &u32| depths[scaled.observations.source[*k as usize] as usize].is_finite();
        let chosen: Vec<u32> = (0..scaled.observations.n as u32).filter(known).collect();
        if chosen.len() < scaled.observations.n {
            scaled.observations = scaled.observations.subset(&chosen);
        }
    }
    if scaled.observations.n < LEAST {
        let sigma = if scaled.unknown { f64::NAN } else { sigma };
        return MotionEstimate::nothing(flow.len(), Status::TooFewPoints, sigma);
    }
    scaled.observations.shared = options.shared.unwrap_or(1.0);
    scaled.observations.prior = options.rotation_prior.as_ref().and_then(Known::new);
    let rng = CounterRng::new(options.seed);
    if let Some(turned) = beforehand(&intake, &scaled.observations, (options.robust, scaled.unknown), rng.stream(5)) {
        scaled.observations = turned;
    }
    if scaled.unknown
        && options.robust
        && let Some(rotation) = turning_in_unknown_noise(&scaled.observations, 0.0)
    {
        // Nothing is left that noise could be estimated from, but for rounding.
        let (before, left) = (scaled.sigma, (rotation.chi2 / (2 * scaled.observations.n - 3) as f64).sqrt());
        scaled.take(left);
        let (all, rotation) = (&scaled.observations, rotation.in_units(before / scaled.sigma));
        return rotation_report(flow, all, all, &rotation, scaled.sigma);
    }
    if options.robust {
        let Some(kept) = exact_consensus(&intake, &mut scaled, rng.stream(1)) else {
            return MotionEstimate::nothing(flow.len(), Status::IllConditioned, scaled.sigma);
        };
        let inner = scaled.observations.subset(&kept.inner);
        let found = on(&intake, options, &mut scaled, inner, Some(&kept), rng);
        let found = with_all_inliers(found, &scaled.observations, &kept);
        doubted(found, &scaled.observations, &kept)
    } else {
        if !scaled.unknown
            && let Some(rotation) = turning(&scaled.observations)
        {
            return rotation_report(flow, &scaled.observations, &scaled.observations, &rotation, scaled.sigma);
        }
        let inliers = scaled.observations.clone();
        on(&intake, options, &mut scaled, inliers, None, rng)
    }
}

/// The points that obey one motion, with its rotation taken out of their displacements where that makes a difference to who obeys.
fn exact_consensus(intake: &Intake<'_>, scaled: &mut Scaled, rng: CounterRng) -> Option<Consensus> {
    let mut kept = consensus(scaled, rng)?;
    for _ in 0..TURNS {
        let obeying = scaled.observations.subset(&kept.inliers);
        if !decides(intake, &obeying, &kept.motion) {
            break;
        }
        scaled.observations = intake.turned(&scaled.observations, HalfTurn::of(&kept.motion));
        kept = consensus(scaled, rng)?;
    }
    Some(kept)
}

/// The points that obey one motion, judged by their own errors.
fn consensus(scaled: &mut Scaled, rng: CounterRng) -> Option<Consensus> {
    let own = scaled.observations.own();
    scaled.observations.rescale(1.0 / own);
    let found = robust::consensus(scaled, rng);
    scaled.observations.rescale(own);
    let mut found = found?;
    for rival in &mut found.rivals {
        rival.excess *= own * own;
    }
    Some(found)
}

/// The rotation alone, where chance explains what it leaves: of errors that points share there are fewer.
fn turning(observations: &Observations) -> Option<RotationOnly> {
    let rotation = rotation_only(observations)?;
    by_chance(rotation.chi2, (2 * observations.n - 3) as f64 / observations.shared).then_some(rotation)
}

/// The same where the noise is to be estimated: `cost` is what the best motion leaves.
///
/// If there were no translation, that would take no more away than the same share of any noise, and what the choice of a direction takes.
fn turning_in_unknown_noise(observations: &Observations, cost: f64) -> Option<RotationOnly> {
    let rotation = rotation_only(observations)?;
    let n = observations.n as f64;
    let sigma2 = rotation.chi2 / (2.0 * n - 3.0);
    let left = cost / (n - 5.0).max(1.0);
    let none = rotation.chi2 <= ROUNDING * ROUNDING * observations.median_flow().powi(2) * n;
    (none || (left / sigma2).ln() > -SEARCHED / n.sqrt() - FEW_POINTS / n).then_some(rotation)
}

/// Standard deviations by which the best of all directions explains pure noise better than any one would, and a margin.
const SEARCHED: f64 = 5.5;
/// What few points add to that.
const FEW_POINTS: f64 = 12.0;

/// Estimates on the points that obey one motion.
fn on(
    intake: &Intake<'_>,
    options: &MotionOptions,
    scaled: &mut Scaled,
    mut inliers: Observations,
    known: Option<&Consensus>,
    rng: CounterRng,
) -> MotionEstimate {
    let flow = intake.flow;
    let mut found = match (&options.initial, known) {
        (Some(initial), _) => {
            let initial = Motion::new(initial.translation, initial.rotation);
            vec![refine(&inliers, initial, None, Effort::FULL)]
        }
        (None, None) => minima(&inliers, rng.stream(2)),
        (None, Some(known)) => again(&inliers, known),
    };
    let Some(&first) = found.first() else {
        return MotionEstimate::nothing(flow.len(), Status::IllConditioned, scaled.sigma);
    };
    settle(intake, &mut scaled.observations, &mut inliers, &mut found, &first, scaled.unknown);
    let best = found[0].equations.cost;
    let rivals: &[Rival] = known.map_or(&[], |known| &known.rivals);
    if scaled.unknown {
        if let Some(rotation) = turning_in_unknown_noise(&inliers, best) {
            let sigma = (rotation.chi2 / (2 * inliers.n - 3) as f64).sqrt();
            let factor = rescaled(scaled, &mut inliers, sigma);
            return rotation_report(flow, &scaled.observations, &inliers, &rotation.in_units(factor), scaled.sigma);
        }
        let sigma = (best / inliers.n.saturating_sub(5).max(1) as f64).sqrt();
        rescaled(scaled, &mut inliers, sigma);
        found = found.iter().map(|minimum| refine(&inliers, minimum.motion, None, Effort::FULL)).collect();
    } else if options.robust
        && let Some(rotation) = turning(&inliers)
    {
        return rotation_report(flow, &scaled.observations, &inliers, &rotation, scaled.sigma);
    }
    let preferred_of = |inliers: &Observations, found: &[Minimum]| {
        if options.initial.is_some() {
            let given = |minimum: &Minimum| Candidate { cost: minimum.equations.cost, minimum: *minimum };
            return (found.iter().map(given).collect(), None);
        }
        choose(inliers, found, || DepthSmoother::new(inliers, options.smoother, rng.stream(3)))
    };
    let (mut candidates, mut made) = preferred_of(&inliers, &found);
    if matters(intake, &inliers, candidates[0].motion()) {
        // Chosen for its depths, with the rotation of another one taken out.
        settle(intake, &mut scaled.observations, &mut inliers, &mut found, &candidates[0].minimum, false);
        (candidates, made) = preferred_of(&inliers, &found);
    }
    let chosen = candidates[0];
    let smoother = || DepthSmoother::new(&inliers, options.smoother, rng.stream(3));
    let wanted = match options.method {
        Method::Auto => inliers.n >= SMOOTHED,
        Method::Efficient => true,
        Method::MaximumLikelihood => false,
    };
    let plugged = plugged(&chosen.minimum.equations);
    let low = plugged.is_none();
    let several = close(&candidates, inliers.n).len() > 1;
    let astray = plugged.as_ref().is_some_and(|plugged| beyond_theory(&inliers, &chosen.minimum, plugged));
    let trial = if wanted || low || several || astray {
        smoothed(&inliers, options, &candidates, made, smoother)
    } else {
        None
    };
    let (improved, mut undecided) = trial.map_or((None, None), |Trial { best, undecided }| (Some(best), undecided));
    if let Some(best) = improved.as_ref().filter(|_| !wanted) {
        undecided = preferred(best, &chosen, plugged.as_ref()).or(undecided);
    }
    let improved = improved.filter(|_| wanted || low || astray);
    let unknown = low && improved.is_none();
    let mut solution = Solution::new(&chosen, plugged.as_ref(), improved, wanted);
    if unknown {
        let mut smoother = DepthSmoother::new(&inliers, options.smoother, rng.stream(3));
        let at = unsolved(&inliers, &solution.motion, WeightDepths::Smoothed(&mut smoother));
        solution.covariance = at.map(|at| at.covariance);
    }
    if let Some(known) = known {
        solution.among_strays(&scaled.observations, known, options.weight_depths.is_some());
    }
    solution.widen(&inliers, flow, options.correlation_length);
    if scaled.unknown {
        let widened = of_estimated_noise(inliers.n, known.is_some());
        solution.covariance = solution.covariance.map(|covariance| covariance * widened);
    }
    solution.alternatives = close(&candidates, inliers.n)[1..]
        .iter()
        .map(|other| Alternative { motion: *other.motion(), excess: other.cost - chosen.cost })
        .collect();
    let deviation = plugged.as_ref().map_or(0.0, |plugged| direction_deviation(&plugged.likelihood));
    let likelihood = (*chosen.motion(), chosen.minimum.equations.behind);
    let evidence = Evidence { likelihood, deviation, low, rivals, undecided };
    judge(intake, &inliers, &mut solution, &evidence, rng.stream(4));
    report(flow, &scaled.observations, &inliers, &solution, scaled.sigma)
}

/// The smoothed weights' solution where it is not the minimum that maximum likelihood chose: then either may be true.
fn preferred(best: &Efficient, chosen: &Candidate, plugged: Option<&Plugged>) -> Option<Alternative> {
    let deviation = plugged.map_or(0.0, |plugged| direction_deviation(&plugged.likelihood));
    let deviation = deviation.max(direction_deviation(&best.covariance));
    let apart = best.motion.angle_to(chosen.motion()).to_degrees() > DISTINCT * deviation;
    apart.then_some(Alternative { motion: best.motion, excess: 0.0 })
}

/// The minimum that a robust search led to, and those that other minima for the same points lead to.
///
/// Among many strays that motion is the likeliest as it is.
fn again(inliers: &Observations, known: &Consensus) -> Vec<Minimum> {
    if known.many {
        return vec![refine(inliers, known.motion, None, Effort::NONE)];
    }
    let others = known.rivals.iter().filter(|rival| !rival.others).map(|rival| rival.motion);
    let motions: Vec<Motion> = std::iter::once(known.motion).chain(others).collect();
    different(motions.into_par_iter().map(|motion| refine(inliers, motion, None, Effort::FULL)).collect())
}

/// Takes `sigma` to be the noise of all points and of the inliers; returns what everything was multiplied with.
fn rescaled(scaled: &mut Scaled, inliers: &mut Observations, sigma: f64) -> f64 {
    let before = scaled.sigma;
    scaled.take(sigma);
    let factor = before / scaled.sigma;
    inliers.rescale(factor);
    factor
}
