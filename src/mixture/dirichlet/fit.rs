//! Entry points: starts, rounds and merging.

use super::em::{Problem, Run};
use super::merge::pool_pairs;
use super::options::DirichletOptions;
use super::result::DirichletMixture;
use super::sticks;
use crate::error::Result;
use crate::math::random::CounterRng;
use crate::mixture::moments::Moments;
use crate::mixture::points::{Planes, Points};
use crate::mixture::seeding;
use crate::mixture::start::{from_labels, from_shares};

/// Fits a Dirichlet-process mixture of Gaussians to weighted points.
///
/// A weight is a number of observations: 3 is the point three times. From each start expectation-maximization
/// runs until the mean log-likelihood stands; then pairs of components are pooled while that raises the score
/// F. Of `n_init` starts the one with the largest F is kept. Computed in `f64`. The result does not depend on
/// the number of threads, nor on the order of the points except for rounding.
///
/// # Errors
/// [`Error::Argument`](crate::Error::Argument) naming an option, the points (`X`) or their weights
/// (`sample_weight`).
pub fn fit_dirichlet(points: &Points, options: &DirichletOptions) -> Result<DirichletMixture> {
    let problem = Problem::new(points, options)?;
    options.threads.install(|| {
        let rng = CounterRng::new(options.random_state);
        let standardised = standardised(points, &problem.planes);
        let standard = Points { values: &standardised, ..*points };
        let mut best: Option<Run> = None;
        for init in 0..options.n_init {
            let labels = seeding::k_means(&standard, options.n_components, rng.stream(init as u64));
            let start = from_labels(points, &problem.planes.centre, options.n_components, &labels);
            let run = run_and_merge(&problem, start.moments)?;
            if best.as_ref().is_none_or(|best| run.score > best.score) {
                best = Some(run);
            }
        }
        Ok(reported(&problem, best.expect("n_init is positive")))
    })
}

/// As [`fit_dirichlet`], from responsibilities (N, K), row-major, in place of seeds; `n_init` is not used.
///
/// # Errors
/// As [`fit_dirichlet`], and named `resp` for responsibilities of another shape, negative, not finite, or of
/// rows that do not sum to 1.
pub fn fit_dirichlet_from(points: &Points, options: &DirichletOptions, shares: &[f64]) -> Result<DirichletMixture> {
    let problem = Problem::new(points, options)?;
    let start = from_shares(points, &problem.planes.centre, options.n_components, shares)?;
    options.threads.install(|| Ok(reported(&problem, run_and_merge(&problem, start.moments)?)))
}

/// Coordinates (N, D) about the mean over the standard deviation of their axis, where that is not 0.
fn standardised(points: &Points, planes: &Planes) -> Vec<f64> {
    let d = points.dimensions;
    let scale = |axis: usize| {
        let squares = planes.plane(axis).iter().zip(&planes.weights).map(|(x, w)| w * x * x).sum::<f64>();
        let deviation = (squares / planes.total).sqrt();
        if deviation > 0.0 { deviation } else { 1.0 }
    };
    let scales: Vec<f64> = (0..d).map(scale).collect();
    (0..points.count() * d).map(|at| planes.plane(at % d)[at / d] / scales[at % d]).collect()
}

/// Rounds from the moments of the first responsibilities and, if the options say so, merging.
fn run_and_merge(problem: &Problem, start: Moments) -> Result<Run> {
    let run = problem.run(start)?;
    if problem.options.merge { pool_pairs(problem, run) } else { Ok(run) }
}

/// The result in the coordinates of the points.
fn reported(problem: &Problem, run: Run) -> DirichletMixture {
    let weights = sticks::proportions(&run.counts, problem.options.weight_concentration, problem.options.inference);
    let mut components = run.components;
    for mean in components.means.chunks_exact_mut(problem.planes.dimensions) {
        mean.iter_mut().zip(&problem.planes.centre).for_each(|(mean, centre)| *mean += centre);
    }
    DirichletMixture {
        dimensions: problem.planes.dimensions,
        weights,
        log_factors: components.log_factors,
        means: components.means,
        covariances: components.covariances,
        counts: run.counts,
        lower_bound: run.score,
        n_iter: run.rounds,
        converged: run.converged,
    }
}
