//! Rounds of M and E steps from each start.

use super::components::Components;
use super::merge;
use super::options::DirichletOptions;
use super::result::DirichletMixture;
use super::score::Scorer;
use crate::error::Result;
use crate::math::random::CounterRng;
use crate::mixture::densities::Densities;
use crate::mixture::expectation::{Expected, expect};
use crate::mixture::moments::Moments;
use crate::mixture::points::{Planes, Points};
use crate::mixture::seeding;
use crate::mixture::start::{from_labels, from_shares};

/// Fits a Dirichlet-process mixture of Gaussians to weighted points.
///
/// A weight is a number of observations: 3 is the point three times. From each start expectation-maximization runs until the mean
/// log-likelihood stands; then pairs of components are pooled while that raises the score F. Of `n_init` starts the one with the
/// largest F is kept. Computed in `f64`. The result does not depend on the number of threads, nor on the order of the points
/// except for rounding.
///
/// # Errors
/// [`Error::Argument`](crate::Error::Argument) naming an option, the points (`X`) or their weights (`sample_weight`).
pub fn fit_dirichlet(points: &Points, options: &DirichletOptions) -> Result<DirichletMixture> {
    let problem = Problem::new(points, options)?;
    options.threads.install(|| {
        let rng = CounterRng::new(options.seed);
        let standardised = standardised(points, &problem.planes);
        let standard = Points { values: &standardised, ..*points };
        let mut best: Option<Run> = None;
        for init in 0..options.n_init {
            let labels = seeding::k_means(&standard, options.n_components, rng.stream(init as u64));
            let start = from_labels(points, &problem.planes.centre, options.n_components, &labels);
            let run = problem.run_and_merge(start.moments)?;
            if best.as_ref().is_none_or(|best| run.score > best.score) {
                best = Some(run);
            }
        }
        Ok(problem.reported(best.expect("n_init is positive")))
    })
}

/// As [`fit_dirichlet`], from responsibilities (N, K), row-major, in place of seeds; `n_init` is not used.
///
/// # Errors
/// As [`fit_dirichlet`], and named `resp` for responsibilities of another shape, negative, not finite, or of rows that do not sum
/// to 1.
pub fn fit_dirichlet_from(points: &Points, options: &DirichletOptions, shares: &[f64]) -> Result<DirichletMixture> {
    let problem = Problem::new(points, options)?;
    let start = from_shares(points, &problem.planes.centre, options.n_components, shares)?;
    options.threads.install(|| Ok(problem.reported(problem.run_and_merge(start.moments)?)))
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

/// What rounds of expectation-maximization lead to, in coordinates about the mean of the points.
#[derive(Debug)]
pub(super) struct Run {
    /// The components of the last M step, in the order of decreasing weight.
    pub components: Components,
    /// `N_k` (K) that the last M step was made from.
    pub counts: Vec<f64>,
    /// Indices of the components with a share, and their densities.
    pub used: Vec<usize>,
    pub densities: Densities,
    /// What the last E step left of the points (K).
    pub expected: Expected,
    /// F of the last E step's responsibilities.
    pub score: f64,
    pub rounds: usize,
    pub converged: bool,
}

/// All that stays the same during a fit.
#[derive(Debug)]
pub(super) struct Problem<'a> {
    pub planes: Planes,
    pub scorer: Scorer,
    options: &'a DirichletOptions,
}

impl<'a> Problem<'a> {
    fn new(points: &Points, options: &'a DirichletOptions) -> Result<Self> {
        options.check()?;
        points.check()?;
        let planes = Planes::new(points, points.mean());
        let scorer = Scorer::new(options.prior(points)?, planes.total)?;
        Ok(Self { planes, scorer, options })
    }

    fn run_and_merge(&self, start: Moments) -> Result<Run> {
        let run = self.run(start)?;
        if self.options.merge { merge::pool_pairs(self, run) } else { Ok(run) }
    }

    /// M and E steps in turns from the moments of the first responsibilities.
    pub fn run(&self, mut moments: Moments) -> Result<Run> {
        let mut last = f64::NAN;
        let mut rounds = 0;
        loop {
            moments = moments.reordered(&by_weight(&moments.counts));
            let components = Components::maximised(self.scorer.prior(), self.options, &moments);
            let (used, densities) = components.densities()?;
            let expected = expect(&self.planes, &densities);
            rounds += 1;
            let likelihood = log_likelihood(&densities, &expected);
            let change = (likelihood - last).abs();
            let converged = self.options.tol.is_some_and(|tol| change < tol * self.planes.total);
            let counts = moments.counts;
            let expected = spread(expected, &used, components.count());
            if converged || rounds >= self.options.max_iter {
                let score = self.scorer.score(&expected.moments, expected.negentropy)?;
                return Ok(Run { components, counts, used, densities, expected, score, rounds, converged });
            }
            last = likelihood;
            moments = expected.moments;
        }
    }

    /// The result in the coordinates of the points.
    fn reported(&self, run: Run) -> DirichletMixture {
        let weights =
            super::sticks::proportions(&run.counts, self.options.weight_concentration, self.options.inference);
        let mut components = run.components;
        for mean in components.means.chunks_exact_mut(self.planes.dimensions) {
            mean.iter_mut().zip(&self.planes.centre).for_each(|(mean, centre)| *mean += centre);
        }
        DirichletMixture {
            dimensions: self.planes.dimensions,
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
}

/// Components in the order of decreasing weight; equal ones keep their order.
fn by_weight(counts: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..counts.len()).collect();
    order.sort_by(|a, b| counts[*b].total_cmp(&counts[*a]));
    order
}

/// What an E step left of the components in `used`, with zeros for the others of all `components`.
fn spread(expected: Expected, used: &[usize], components: usize) -> Expected {
    if used.len() == components {
        return expected;
    }
    let d = expected.moments.dimensions;
    let mut moments = Moments::none(components, d);
    for (from, to) in used.iter().enumerate() {
        moments.replace(*to, &expected.moments.reordered(&[from]));
    }
    Expected { moments, negentropy: expected.negentropy }
}

/// `sum_n w_n ln sum_k rho_nk` of an E step from the sums that it leaves.
///
/// `sum_n w_n sum_k r_nk ln rho_nk` less the negative entropy of r; the former is known from the moments, as `ln rho` is quadratic.
fn log_likelihood(densities: &Densities, expected: &Expected) -> f64 {
    let (d, moments) = (densities.dimensions, &expected.moments);
    let mut sum = -expected.negentropy;
    for (k, count) in moments.counts.iter().copied().enumerate().filter(|(_, count)| *count > 0.0) {
        sum += count * densities.constants[k];
        let mut rows = &densities.whitening[k * densities.triangle()..];
        let off = |i: usize| moments.means[k * d + i] - densities.means[k * d + i];
        let second = |i: usize, j: usize| moments.scatters[(k * d + i) * d + j] + count * off(i) * off(j);
        for i in 0..d {
            let (row, rest) = rows.split_at(i + 1);
            for (a, left) in row.iter().enumerate() {
                sum -= row.iter().enumerate().map(|(b, right)| left * right * second(a, b)).sum::<f64>();
            }
            rows = rest;
        }
    }
    sum
}
