//! Rounds of M and E steps until the lower bound stands.

use super::bound::{PriorTerms, lower_bound};
use super::densities::{Densities, Factors};
use super::expectation::{Expected, expect};
use super::moments::Moments;
use super::options::{MixtureOptions, Seeding};
use super::points::{Planes, Points};
use super::posterior::Posterior;
use super::prior::Prior;
use super::seeding;
use super::start::{from_labels, from_shares};
use crate::error::Result;
use crate::math::random::CounterRng;
use crate::parallel::checkpoint;

/// Where a fit begins.
#[derive(Debug, Clone, Copy)]
pub enum Start<'a> {
    /// As [`MixtureOptions::seeding`] says, [`MixtureOptions::n_init`] times.
    Seeds,
    /// With an M step from these responsibilities (N, K), row-major.
    Responsibilities(&'a [f64]),
    /// With an E step under these components, of any number.
    Components(&'a Posterior),
}

/// A fitted mixture.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The components after the last M step.
    pub posterior: Posterior,
    /// The prior, with what was taken from the points.
    pub prior: Prior,
    /// The lower bound after each M step. It never falls, unless components were left out.
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

/// Fits a mixture to weighted points. Precision: `f64`. The result does not depend on the number of threads,
/// nor, from seeds, on the order of the points, but for rounding.
///
/// # Errors
/// [`Error::Argument`](crate::error::Error::Argument) naming an option, the points (`X`), their weights
/// (`sample_weight`), the responsibilities (`resp`) or components (`start`) that cannot be used.
pub fn fit(points: &Points, options: &MixtureOptions, start: Start) -> Result<Fit> {
    options.check()?;
    points.check()?;
    let prior = Prior::resolve(options, points)?;
    let problem = Problem::new(points, points.mean(), prior, options, None)?;
    options.threads.install(|| match start {
        Start::Seeds => best_of_seeds(points, &problem),
        Start::Responsibilities(shares) => {
            problem.rounds(from_shares(points, &problem.planes.centre, options.components, shares)?)
        }
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
    let (centre, components) = (&problem.planes.centre, options.components);
    let rng = CounterRng::new(options.random_state);
    let mut best: Option<Fit> = None;
    for init in 0..options.n_init {
        let stream = rng.stream(init as u64);
        let expected = match options.seeding {
            Seeding::KMeans => from_labels(points, centre, components, &seeding::k_means(points, components, stream)),
            Seeding::Random => from_shares(points, centre, components, &seeding::random(points, components, stream))?,
        };
        let fit = problem.rounds(expected)?;
        if best.as_ref().is_none_or(|best| fit.lower_bound() > best.lower_bound()) {
            best = Some(fit);
        }
    }
    Ok(best.expect("n_init is positive"))
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
            checkpoint();
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
                return Ok(self.result(posterior, moments, negentropy, lower_bounds, converged));
            }
            if !same_components {
                factors = Factors::of(&posterior)?;
            }
            expected = expect(&self.planes, &Densities::of(&posterior, &factors));
        }
    }

    /// Leaves out components with too few points, but never the last; whether any.
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
    fn result(
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
