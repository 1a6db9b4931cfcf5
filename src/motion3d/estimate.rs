//! Entry point: estimates rigid motion from optical flow.

use super::diagnostics::report::{doubted, rotation_report, with_all_inliers};
use super::diagnostics::rotation_only::{
    explained_by_rotation, explained_by_rotation_in_unknown_noise, without_likeliest_rotation,
};
use super::fit::Task;
use super::model::input::{Flow, Noise};
use super::model::observations::Scaled;
use super::model::options::{MotionOptions, RotationPrior};
use super::model::result::{MotionEstimate, Status};
use super::model::whitening::Whitening;
use super::robust;
use super::robust::Consensus;
use crate::error::Result;
use crate::math::random::CounterRng;

/// Least number of points for a motion.
pub(crate) const MIN_POINTS: usize = 5;

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
    if scaled.observations.n < MIN_POINTS {
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
            let before = scaled.noise_std;
            scaled.take((rotation.chi2 / (2 * scaled.observations.n - 3) as f64).sqrt());
            rotation.in_units(before / scaled.noise_std)
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
        return Task { whitening: &whitening, options, known: None, rng }.on(&mut scaled, inliers);
    }
    let Some(kept) = consensus(&whitening, &mut scaled, rng.stream(1)) else {
        return MotionEstimate::nothing(flow.len(), Status::IllConditioned, scaled.noise_std);
    };
    let inner = scaled.observations.subset(&kept.inner);
    let found = Task { whitening: &whitening, options, known: Some(&kept), rng }.on(&mut scaled, inner);
    doubted(with_all_inliers(found, &scaled.observations, &kept), &scaled.observations, &kept)
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
