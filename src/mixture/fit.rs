//! Rounds of M and E steps until the lower bound stands.

use super::bound::{PriorTerms, lower_bound};
use super::expectation::{Expected, expect};
use super::moments::Moments;
use super::options::{MixtureOptions, Seeding};
use super::points::{Planes, Points};
use super::posterior::{Densities, Factors, Posterior};
use super::prior::Prior;
use super::seeding;
use crate::error::{Error, Result};
use crate::math::random::CounterRng;

/// How far from 1 the responsibilities of a point may sum up.
const SUM_TOLERANCE: f64 = 1e-6;

/// Where a fit begins.
#[derive(Debug, Clone, Copy)]
pub enum Start<'a> {
    /// As [`MixtureOptions::seeding`] says, [`MixtureOptions::n_init`] times.
    Seeds,
    /// With an M step from these responsibilities (N, K), row-major.
    Responsibilities(&'a [f64]),
    /// With an E step under these components, of which there may be another number than [`MixtureOptions::components`].
    Components(&'a Posterior),
}

/// A fitted mixture.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The components after the last M step.
    pub posterior: Posterior,
    /// The prior, with what was taken from the points.
    pub prior: Prior,
    /// The lower bound after each M step, natural logarithms. It never falls, unless components were left out.
    pub lower_bounds: Vec<f64>,
    /// Whether the bound stood before the rounds were up.
    pub converged: bool,
    /// Sums over the points that the last M step was made from.
    pub moments: Moments,
    /// `sum_n f_n sum_k r_nk ln r_nk` of the responsibilities that the last M step was made from.
    pub negentropy: f64,
}

impl Fit {
    /// The last lower bound.
    pub fn lower_bound(&self) -> f64 {
        self.lower_bounds.last().copied().unwrap_or(f64::NEG_INFINITY)
    }
}

/// Fits a mixture to weighted points. Precision: `f64`. The result does not depend on the number of threads, nor, from seeds, on the order of the points, but for rounding.
///
/// # Errors
/// [`Error::Argument`] naming an option, the points (`X`), their weights (`sample_weight`), the responsibilities (`resp`) or components (`start`) that cannot be used.
pub fn fit(points: &Points, options: &MixtureOptions, start: Start) -> Result<Fit> {
    options.check()?;
    points.check()?;
    let prior = Prior::resolve(options, points)?;
    let problem = Problem::new(points, points.mean(), prior, options, None)?;
    options.threads.install(|| match start {
        Start::Seeds => best_of_seeds(points, &problem),
        Start::Responsibilities(shares) => problem.rounds(from_shares(points, &problem, shares, options.components)?),
        Start::Components(posterior) => {
            posterior.check(points.dimensions)?;
            let posterior = posterior.clone().moved(&problem.planes.centre, -1.0);
            let densities = Densities::of(&posterior, &Factors::of(&posterior)?);
            problem.rounds(expect(&problem.planes, &densities))
        }
    })
}

/// The best of `n_init` fits.
pub(super) fn best_of_seeds(points: &Points, problem: &Problem) -> Result<Fit> {
    let options = problem.options;
    let rng = CounterRng::new(options.seed);
    let mut best: Option<Fit> = None;
    for init in 0..options.n_init {
        let stream = rng.stream(init as u64);
        let expected = match options.seeding {
            Seeding::KMeans => from_labels(points, problem, &seeding::k_means(points, options.components, stream)),
            Seeding::Random => {
                from_shares(points, problem, &seeding::random(points, options.components, stream), options.components)?
            }
        };
        let fit = problem.rounds(expected)?;
        if best.as_ref().is_none_or(|best| fit.lower_bound() > best.lower_bound()) {
            best = Some(fit);
        }
    }
    Ok(best.expect("n_init is positive"))
}

/// What an E step would have left that gave every point to one component.
fn from_labels(points: &Points, problem: &Problem, labels: &[usize]) -> Expected {
    let centre = &problem.planes.centre;
    let moments = Moments::of(points, centre, problem.options.components, |n, take| take(labels[n], 1.0));
    Expected { moments, negentropy: 0.0 }
}

/// What an E step with these responsibilities would have left.
fn from_shares(points: &Points, problem: &Problem, shares: &[f64], components: usize) -> Result<Expected> {
    if shares.len() != points.count() * components {
        let expected = format!("responsibilities ({}, {components})", points.count());
        return Err(Error::argument("resp", expected, format!("{} numbers", shares.len())));
    }
    if let Some(share) = shares.iter().find(|r| !(r.is_finite() && **r >= 0.0)) {
        return Err(Error::argument("resp", "finite responsibilities that are not negative", share));
    }
    let sums = shares.chunks_exact(components).map(|row| row.iter().sum::<f64>());
    if let Some((n, sum)) = sums.enumerate().find(|(_, sum)| (sum - 1.0).abs() > SUM_TOLERANCE) {
        return Err(Error::argument("resp", "rows that sum to 1", format!("{sum} in row {n}")));
    }
    let entropy = |row: &[f64]| row.iter().filter(|r| **r > 0.0).map(|r| r * r.ln()).sum::<f64>();
    let rows = shares.chunks_exact(components).enumerate();
    let negentropy = rows.map(|(n, row)| points.weight(n) * entropy(row)).sum();
    let moments = Moments::of(points, &problem.planes.centre, components, |n, take| {
        let row = &shares[n * components..(n + 1) * components];
        row.iter().enumerate().filter(|(_, share)| **share > 0.0).for_each(|(k, share)| take(k, *share));
    });
    Ok(Expected { moments, negentropy })
}

/// What earlier points left: their sums about the planes' centre, negative entropy and total weight.
#[derive(Debug)]
pub(super) struct Earlier {
    pub moments: Moments,
    pub negentropy: f64,
    pub total: f64,
}

/// All that stays the same while a fit lasts, in coordinates about a centre.
#[derive(Debug)]
pub(super) struct Problem<'a> {
    pub planes: Planes,
    prior: Prior,
    terms: PriorTerms,
    options: &'a MixtureOptions,
    earlier: Option<Earlier>,
}

impl<'a> Problem<'a> {
    /// `prior` in the points' coordinates, `earlier` about the centre.
    pub fn new(
        points: &Points,
        centre: Vec<f64>,
        mut prior: Prior,
        options: &'a MixtureOptions,
        earlier: Option<Earlier>,
    ) -> Result<Self> {
        prior.mean.iter_mut().zip(&centre).for_each(|(m, c)| *m -= c);
        let terms = PriorTerms::of(&prior)?;
        Ok(Self { planes: Planes::new(points, centre), prior, terms, options, earlier })
    }

    /// M and E steps in turns, from what an E step left. `lower_bounds[t]` is the bound after M step t.
    pub fn rounds(&self, mut expected: Expected) -> Result<Fit> {
        let earlier = self.earlier.as_ref();
        let total = self.planes.total + earlier.map_or(0.0, |earlier| earlier.total);
        let mut lower_bounds = Vec::new();
        let mut same_components = true;
        loop {
            let mut moments = earlier.map_or_else(|| expected.moments.clone(), |e| e.moments.merged(&expected.moments));
            let negentropy = expected.negentropy + earlier.map_or(0.0, |earlier| earlier.negentropy);
            let mut posterior = Posterior::maximised(&self.prior, &moments);
            let mut factors = Factors::of(&posterior)?;
            lower_bounds.push(lower_bound(&self.prior, &self.terms, &posterior, &factors, (negentropy, total)));
            let grown = lower_bounds.iter().rev().take(2).copied().reduce(|last, before| last - before);
            let compared = lower_bounds.len() > 1 && same_components;
            let mut converged =
                compared && self.options.tol.is_some_and(|tol| grown.is_some_and(|grown| grown < tol * total));
            same_components = !self.prune(&mut posterior, &mut moments);
            converged &= same_components;
            if converged || lower_bounds.len() >= self.options.max_iter {
                return Ok(self.told(posterior, moments, negentropy, lower_bounds, converged));
            }
            if !same_components {
                factors = Factors::of(&posterior)?;
            }
            expected = expect(&self.planes, &Densities::of(&posterior, &factors));
        }
    }

    /// Leaves out components with too few points, but never the last; whether any. Not while earlier points hold to their numbering.
    fn prune(&self, posterior: &mut Posterior, moments: &mut Moments) -> bool {
        if self.options.prune_weight <= 0.0 || self.earlier.is_some() {
            return false;
        }
        let most = moments.counts.iter().copied().fold(0.0, f64::max);
        let least = self.options.prune_weight.min(most);
        let keep: Vec<bool> = moments.counts.iter().map(|count| *count >= least).collect();
        if keep.iter().all(|keep| *keep) {
            return false;
        }
        posterior.retain(&keep);
        moments.retain(&keep);
        true
    }

    /// The result in the points' coordinates.
    fn told(
        &self,
        posterior: Posterior,
        mut moments: Moments,
        negentropy: f64,
        lower_bounds: Vec<f64>,
        converged: bool,
    ) -> Fit {
        let centre = &self.planes.centre;
        for mean in moments.means.chunks_exact_mut(centre.len()) {
            mean.iter_mut().zip(centre).for_each(|(m, c)| *m += c);
        }
        let mut prior = self.prior.clone();
        prior.mean.iter_mut().zip(centre).for_each(|(m, c)| *m += c);
        Fit { posterior: posterior.moved(centre, 1.0), prior, lower_bounds, converged, moments, negentropy }
    }

    /// The E step under components in the points' coordinates.
    pub fn expected(&self, posterior: &Posterior) -> Result<Expected> {
        let posterior = posterior.clone().moved(&self.planes.centre, -1.0);
        Ok(expect(&self.planes, &Densities::of(&posterior, &Factors::of(&posterior)?)))
    }
}
