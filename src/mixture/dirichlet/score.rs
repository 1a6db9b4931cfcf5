//! The score F of a division of the points among components.

use super::sticks;
use crate::error::Result;
use crate::mixture::bound::{PriorTerms, gaussian_constant, with_gaussians};
use crate::mixture::densities::Factors;
use crate::mixture::moments::Moments;
use crate::mixture::posterior::Posterior;
use crate::mixture::prior::Prior;

/// Prior of the components, and what the score has of it.
#[derive(Debug)]
pub(super) struct Scorer {
    prior: Prior,
    terms: PriorTerms,
    /// Weight of all points.
    total: f64,
}

impl Scorer {
    /// # Errors
    /// [`Error::Numerical`](crate::Error::Numerical) for a prior scale without a factor.
    pub fn new(prior: Prior, total: f64) -> Result<Self> {
        let terms = PriorTerms::of(&prior)?;
        Ok(Self { prior, terms, total })
    }

    /// The prior.
    pub fn prior(&self) -> &Prior {
        &self.prior
    }

    /// `F(r) = sum_k ln m_k + sticks - sum_n w_n sum_k r_nk ln r_nk`, the last sum being `negentropy`. The
    /// evidence `m_k` of the points of one Gaussian is exact. Components in any order.
    ///
    /// # Errors
    /// [`Error::Numerical`](crate::Error::Numerical) for a scatter without a factor.
    pub fn score(&self, moments: &Moments, negentropy: f64) -> Result<f64> {
        let gaussians = self.gaussians(moments)?;
        let constant = gaussian_constant(moments.dimensions, self.total);
        Ok(gaussians - constant + self.sticks(moments.counts.clone()) - negentropy)
    }

    /// `sum_k ln m_k` without `D F / 2 ln 2 pi`.
    pub fn gaussians(&self, moments: &Moments) -> Result<f64> {
        let posterior = Posterior::maximised(&self.prior, moments);
        let factors = Factors::of(&posterior)?;
        Ok(with_gaussians(0.0, &self.prior, &self.terms, &posterior, &factors))
    }

    /// The sticks' part of components with these weights, in any order.
    pub fn sticks(&self, mut counts: Vec<f64>) -> f64 {
        counts.sort_by(|a, b| b.total_cmp(a));
        sticks::log_evidence(&counts, self.prior.weight_concentration)
    }
}
