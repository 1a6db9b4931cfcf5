//! Options of the fit, and the prior that they describe.

use crate::error::{Error, Result};
use crate::mixture::options::CovariancePrior;
use crate::mixture::points::Points;
use crate::mixture::prior::{Prior, data_covariance, scaled_identity};
use crate::parallel::Threads;

/// Largest number of components.
const MAX_COMPONENTS: usize = 1 << 12;
/// Range of the concentrations: logarithms of their gamma functions stay finite.
const CONCENTRATIONS: std::ops::RangeInclusive<f64> = 1e-100..=1e100;
/// Degrees of freedom of the default prior above D: the least integer with a finite mean covariance.
const FREEDOM: f64 = 2.0;

/// How proportions, means and covariances are estimated in the M step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Inference {
    /// The mode of their posterior: expectation-maximization.
    #[default]
    Map,
    /// Expectations under their posterior: variational Bayes.
    Vb,
}

/// Options of [`fit_dirichlet`](super::fit_dirichlet); the default values are in brackets.
#[derive(Debug, Clone, PartialEq)]
pub struct DirichletOptions {
    /// Largest number of components K (12).
    pub n_components: usize,
    /// Concentration `alpha` of the Dirichlet process (1).
    pub weight_concentration: f64,
    /// How the components are estimated (`Map`).
    pub inference: Inference,
    /// Whether pairs of components are pooled while that raises the score (true).
    pub merge: bool,
    /// `kappa0`, the number of points that the prior of a mean is worth (0.01).
    pub mean_precision: f64,
    /// `nu0`, above D - 1 (`None`: D + 2).
    pub degrees_of_freedom: Option<f64>,
    /// `S0`, squared units of the points. [`CovariancePrior::Data`] (default): their covariance over
    /// `K^(2/D)`.
    pub covariance_prior: CovariancePrior,
    /// Variance added to the diagonals of `S0` and of the covariances, squared units of the points (1e-6).
    pub covariance_floor: f64,
    /// Number of starts, of which the one with the largest score is kept (1).
    pub n_init: usize,
    /// Largest number of rounds from each start, and after each pooled pair (100).
    pub max_iter: usize,
    /// Rounds end when the mean log-likelihood of the points changes by less (1e-4). `None`: always
    /// `max_iter` rounds.
    pub tol: Option<f64>,
    /// Seed of the starts (0).
    pub random_state: u64,
    /// Number of threads; results do not depend on it.
    pub threads: Threads,
}

impl Default for DirichletOptions {
    fn default() -> Self {
        Self {
            n_components: 12,
            weight_concentration: 1.0,
            inference: Inference::Map,
            merge: true,
            mean_precision: 0.01,
            degrees_of_freedom: None,
            covariance_prior: CovariancePrior::Data,
            covariance_floor: 1e-6,
            n_init: 1,
            max_iter: 100,
            tol: Some(1e-4),
            random_state: 0,
            threads: Threads::default(),
        }
    }
}

impl DirichletOptions {
    /// Checks every option that does not depend on the points.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the option.
    pub(super) fn check(&self) -> Result<()> {
        for (name, count) in [("n_components", self.n_components), ("n_init", self.n_init), ("max_iter", self.max_iter)]
        {
            if count == 0 {
                return Err(Error::argument(name, "a positive integer", count));
            }
        }
        if self.n_components > MAX_COMPONENTS {
            let expected = format!("a positive integer up to {MAX_COMPONENTS}");
            return Err(Error::argument("n_components", expected, self.n_components));
        }
        for (name, value) in
            [("weight_concentration", self.weight_concentration), ("mean_precision", self.mean_precision)]
        {
            if !CONCENTRATIONS.contains(&value) {
                let expected = format!("a number from {:e} to {:e}", CONCENTRATIONS.start(), CONCENTRATIONS.end());
                return Err(Error::argument(name, expected, format!("{value:e}")));
            }
        }
        for (name, value) in [("covariance_floor", self.covariance_floor), ("tol", self.tol.unwrap_or(0.0))] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(Error::argument(name, "a finite number, at least 0", value));
            }
        }
        self.threads.check().map(|_| ())
    }

    /// The prior of checked `points` in coordinates about their mean: `Psi0 = S0 + floor I`.
    ///
    /// # Errors
    /// [`Error::Argument`] named `covariance_prior` or `degrees_of_freedom`.
    pub(super) fn prior(&self, points: &Points) -> Result<Prior> {
        let d = points.dimensions;
        let mut scale = match &self.covariance_prior {
            CovariancePrior::Data => {
                let shrink = (self.n_components as f64).powf(-2.0 / d as f64);
                data_covariance(points).iter().map(|value| shrink * value).collect()
            }
            CovariancePrior::Isotropic(variance) => scaled_identity(d, *variance),
            CovariancePrior::Full(matrix) => matrix.clone(),
        };
        let mut prior = Prior {
            weight_concentration: self.weight_concentration,
            mean_precision: self.mean_precision,
            mean: vec![0.0; d],
            degrees_of_freedom: self.degrees_of_freedom.unwrap_or(d as f64 + FREEDOM),
            scale_inverse: scale.clone(),
        };
        prior.check(d, "degrees_of_freedom")?;
        add_to_diagonal(&mut scale, d, self.covariance_floor);
        prior.scale_inverse = scale;
        Ok(prior)
    }
}

/// Adds `value` to the diagonals of matrices (K, D, D).
pub(super) fn add_to_diagonal(matrices: &mut [f64], d: usize, value: f64) {
    for matrix in matrices.chunks_exact_mut(d * d) {
        (0..d).for_each(|i| matrix[i * (d + 1)] += value);
    }
}
