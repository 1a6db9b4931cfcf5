//! Options of a fit.

use crate::error::{Error, Result};
use crate::parallel::Threads;

/// Most components: what nobody needs must not take all memory.
const MAX_COMPONENTS: usize = 1 << 16;
/// Counts of points that a prior may be worth: the logarithm of the gamma function stays finite.
const MAX_PRIOR: f64 = 1e100;
/// And of fewer, the bound is none any more.
const MIN_PRIOR: f64 = 1e-100;

/// Where the inverse scale matrix of the Wishart prior, `W0^-1` (D, D), comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum CovariancePrior {
    /// The weighted covariance of the points.
    Data,
    /// This number times the identity.
    Isotropic(f64),
    /// This matrix, row-major.
    Full(Vec<f64>),
}

/// Where a fit without responsibilities begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Seeding {
    /// Weighted k-means++ seeds and ten steps of Lloyd's algorithm.
    #[default]
    KMeans,
    /// Random responsibilities.
    Random,
}

/// Options of [`fit`](super::fit()); the defaults are those of the stereo paper's section on clustering,
/// except where its prior would need a unit.
#[derive(Debug, Clone, PartialEq)]
pub struct MixtureOptions {
    /// Number of components K: 12.
    pub components: usize,
    /// `alpha0` of the Dirichlet prior: 0.1.
    pub weight_concentration_prior: f64,
    /// `beta0`, precision of the means over that of the points: 0.001.
    pub mean_precision_prior: f64,
    /// `m0` (D); none: the weighted mean of the points.
    pub mean_prior: Option<Vec<f64>>,
    /// `nu0` of the Wishart prior, above D - 1; none: D + 9.1.
    pub degrees_of_freedom_prior: Option<f64>,
    /// `W0^-1`: the weighted covariance of the points.
    pub covariance_prior: CovariancePrior,
    /// Most rounds of an M step and an E step: 100.
    pub max_iter: usize,
    /// Rounds end when the bound grows by less than this times the sum of the weights (1e-4), if given.
    pub tol: Option<f64>,
    /// Fits from different seeds, of which that with the greatest lower bound is kept: 1.
    pub n_init: usize,
    /// How fits begin.
    pub seeding: Seeding,
    /// Components with less weight of points than this are left out: 0, none.
    pub prune_weight: f64,
    /// Seed of the random numbers: 0.
    pub random_state: u64,
    /// Number of threads; results do not depend on it.
    pub threads: Threads,
}

impl Default for MixtureOptions {
    fn default() -> Self {
        Self {
            components: 12,
            weight_concentration_prior: 0.1,
            mean_precision_prior: 1e-3,
            mean_prior: None,
            degrees_of_freedom_prior: None,
            covariance_prior: CovariancePrior::Data,
            max_iter: 100,
            tol: Some(1e-4),
            n_init: 1,
            seeding: Seeding::KMeans,
            prune_weight: 0.0,
            random_state: 0,
            threads: Threads::default(),
        }
    }
}

impl MixtureOptions {
    /// Checks every option by itself, whatever the points are.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the option.
    pub fn check(&self) -> Result<()> {
        let positive = |name, value: f64| {
            let sound = value.is_finite() && value > 0.0;
            if sound { Ok(()) } else { Err(Error::argument(name, "a finite number above 0", value)) }
        };
        for (name, count) in [("n_components", self.components), ("max_iter", self.max_iter), ("n_init", self.n_init)] {
            if count == 0 {
                return Err(Error::argument(name, "a positive integer", count));
            }
        }
        if self.components > MAX_COMPONENTS {
            let expected = format!("a positive integer up to {MAX_COMPONENTS}");
            return Err(Error::argument("n_components", expected, self.components));
        }
        for (name, value) in [
            ("weight_concentration_prior", self.weight_concentration_prior),
            ("mean_precision_prior", self.mean_precision_prior),
        ] {
            positive(name, value)?;
            if !(MIN_PRIOR..=MAX_PRIOR).contains(&value) {
                let expected = format!("a positive number from {MIN_PRIOR:e} to {MAX_PRIOR:e}");
                return Err(Error::argument(name, expected, format!("{value:e}")));
            }
        }
        for (name, value) in [("tol", self.tol.unwrap_or(0.0)), ("prune_weight", self.prune_weight)] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(Error::argument(name, "a finite number, at least 0", value));
            }
        }
        self.threads.check().map(|_| ())
    }
}
