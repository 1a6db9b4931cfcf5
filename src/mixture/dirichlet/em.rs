//! Rounds of M and E steps.

use super::{components::Components, options::DirichletOptions, score::Scorer};
use crate::error::Result;
use crate::mixture::densities::Densities;
use crate::mixture::expectation::{Expected, expect};
use crate::mixture::moments::Moments;
use crate::mixture::points::{Planes, Points};
use crate::parallel::checkpoint;

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
    pub options: &'a DirichletOptions,
}

impl<'a> Problem<'a> {
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) naming an option, the points (`X`) or their weights
    /// (`sample_weight`).
    pub fn new(points: &Points, options: &'a DirichletOptions) -> Result<Self> {
        options.check()?;
        points.check()?;
        let planes = Planes::new(points, points.mean());
        let scorer = Scorer::new(options.prior(points)?, planes.total)?;
        Ok(Self { planes, scorer, options })
    }

    /// M and E steps in turns from the moments of the first responsibilities.
    ///
    /// # Errors
    /// [`Error::Numerical`](crate::Error::Numerical) for a covariance without a factor.
    pub fn run(&self, mut moments: Moments) -> Result<Run> {
        let mut last = f64::NAN;
        let mut rounds = 0;
        loop {
            checkpoint();
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
/// `sum_n w_n sum_k r_nk ln rho_nk` less the negative entropy of r; the former is known from the moments, as
/// `ln rho` is quadratic.
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
