//! Points that come in batches, with forgetting.

use super::fit::{Earlier, Fit, Problem, best_of_seeds};
use super::moments::Moments;
use super::options::MixtureOptions;
use super::points::Points;
use super::posterior::Posterior;
use super::prior::Prior;
use crate::error::{Error, Result};

/// What is kept of earlier batches: sums, never points.
#[derive(Debug, Clone)]
pub struct Retained {
    /// The prior of the first batch.
    pub prior: Prior,
    /// The components after the last batch.
    pub posterior: Posterior,
    /// Sums over all points so far, older ones forgotten in part.
    pub moments: Moments,
    /// Their `sum_n f_n sum_k r_nk ln r_nk`.
    pub negentropy: f64,
}

impl Retained {
    /// What a fit leaves for batches to come.
    pub fn of(fit: &Fit) -> Self {
        Self {
            prior: fit.prior.clone(),
            posterior: fit.posterior.clone(),
            moments: fit.moments.clone(),
            negentropy: fit.negentropy,
        }
    }

    /// Sum of the weights of all points so far.
    pub fn total(&self) -> f64 {
        self.moments.counts.iter().sum()
    }
}

/// Adds a batch of weighted points to a mixture; the first one, without anything `retained`, is a fit.
///
/// Responsibilities of earlier points stay what they were when their batch came: only their sums (18) to (20)
/// are kept, all of them times `forgetting`. The rounds maximise the same lower bound as
/// [`fit`](super::fit()), of earlier and new points together, over the responsibilities of the new ones and
/// the components; so it never falls within a batch. With `forgetting` 1 points that would not change their
/// component any more leave what one fit to all of them does; with less, a batch that came n batches ago
/// weighs `forgetting^n`, and the weight of all points together tends to that of one batch over `1 -
/// forgetting`.
///
/// # Errors
/// As [`fit`](super::fit()); [`Error::Argument`] named `forgetting` outside of (0, 1], or `X` for another
/// dimension than before.
pub fn partial_fit(
    points: &Points,
    options: &MixtureOptions,
    retained: Option<&Retained>,
    forgetting: f64,
) -> Result<Fit> {
    options.check()?;
    points.check()?;
    if !(forgetting > 0.0 && forgetting <= 1.0) {
        return Err(Error::argument("forgetting", "a factor above 0 and at most 1", forgetting));
    }
    let Some(retained) = retained else {
        let prior = Prior::resolve(options, points)?;
        let problem = Problem::new(points, points.mean(), prior, options, None)?;
        return options.threads.install(|| best_of_seeds(points, &problem));
    };
    retained.posterior.check(points.dimensions)?;
    // The old sums set the centre, and the batch follows: both are about the same place.
    let centre = points.mean();
    let mut moments = retained.moments.clone();
    moments.scale(forgetting);
    for mean in moments.means.chunks_exact_mut(points.dimensions) {
        mean.iter_mut().zip(&centre).for_each(|(m, c)| *m -= c);
    }
    let earlier =
        Earlier { moments, negentropy: forgetting * retained.negentropy, total: forgetting * retained.total() };
    let problem = Problem::new(points, centre, retained.prior.clone(), options, Some(earlier))?;
    options.threads.install(|| problem.rounds(problem.expected(&retained.posterior)?))
}
