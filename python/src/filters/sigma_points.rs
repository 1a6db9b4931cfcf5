//! `MerweScaledSigmaPoints`.

use crate::errors::Outcome;
use crate::options::{Argument, Integer, count, named};
use crate::{arrays, keywords::getters};
use jacoflow::error::Error;
use jacoflow::filter::{SigmaPoints, check_dimension};
use pyo3::prelude::*;

/// Scaled sigma points (van der Merwe 2004): 2 n + 1 points with mean and covariance of the state.
///
/// `n` dimensions; spread `alpha` (no unit), `beta` 2 for Gaussians, `kappa` secondary spread. The squared
/// spread of the points is alpha^2 (n + kappa).
#[pyclass(module = "jacoflow.filters", frozen, from_py_object)]
#[derive(Clone)]
pub struct MerweScaledSigmaPoints {
    pub n: usize,
    pub points: SigmaPoints,
}

getters! {
    MerweScaledSigmaPoints;
    /// Dimensions of the state (a count, no unit).
    n(this) -> usize = this.n;
    /// Spread of the points (no unit).
    alpha(this) -> f64 = this.points.alpha;
    /// Weight of prior knowledge in the centre's covariance weight (no unit).
    beta(this) -> f64 = this.points.beta;
    /// Secondary spread (no unit).
    kappa(this) -> f64 = this.points.kappa;
    /// Weights of the mean, array (2 n + 1,), centre first (no unit).
    Wm(this, slf) -> Outcome<Bound<'py, PyAny>> = arrays::owned(slf.py(), &[SigmaPoints::count(this.n)], this.points.mean_weights(this.n));
    /// Weights of the covariance, array (2 n + 1,), centre first (no unit).
    Wc(this, slf) -> Outcome<Bound<'py, PyAny>> = arrays::owned(slf.py(), &[SigmaPoints::count(this.n)], this.points.covariance_weights(this.n));
}

impl Argument for MerweScaledSigmaPoints {
    const EXPECTED: &'static str = "MerweScaledSigmaPoints";
}

#[pymethods]
impl MerweScaledSigmaPoints {
    #[new]
    #[pyo3(signature = (n, alpha=None, beta=None, kappa=None))]
    fn new(
        #[pyo3(from_py_with = named::n)] n: Integer,
        #[pyo3(from_py_with = named::alpha)] alpha: Option<f64>,
        #[pyo3(from_py_with = named::beta)] beta: Option<f64>,
        #[pyo3(from_py_with = named::kappa)] kappa: Option<f64>,
    ) -> Outcome<Self> {
        let n = count("n", n)?;
        let default = SigmaPoints::default();
        let (alpha, beta, kappa) =
            (alpha.unwrap_or(default.alpha), beta.unwrap_or(default.beta), kappa.unwrap_or(default.kappa));
        check_dimension("n", n)?;
        let points = SigmaPoints::new(alpha, beta, kappa)?;
        points.check(n)?;
        Ok(Self { n, points })
    }
    /// The same dimensions and spreads.
    fn __eq__(&self, other: &Self) -> bool {
        self.n == other.n && self.points == other.points
    }
    fn __hash__(&self) -> u64 {
        let SigmaPoints { alpha, beta, kappa } = self.points;
        [alpha, beta, kappa].iter().fold(self.n as u64, |hash, part| hash.rotate_left(21) ^ part.to_bits())
    }
    /// Number of points, 2 n + 1 (a count, no unit).
    fn num_sigmas(&self) -> usize {
        SigmaPoints::count(self.n)
    }
    /// The points, array (2 n + 1, n), of mean `x` (n,) and covariance `P` (n, n), in the state's units.
    ///
    /// NumericalError where `P` is not positive definite.
    #[pyo3(signature = (x, P))]
    fn sigma_points<'py>(&self, x: &Bound<'py, PyAny>, P: &Bound<'py, PyAny>) -> Outcome<Bound<'py, PyAny>> {
        let (shape, mean) = arrays::doubles("x", x)?;
        let (shape_p, covariance) = arrays::doubles("P", P)?;
        let n = self.n;
        if shape != [n] {
            return Err(Error::shape("x", &[n], &shape).into());
        }
        if shape_p != [n, n] {
            return Err(Error::shape("P", &[n, n], &shape_p).into());
        }
        let points = self.points.sigma_points(&mean, &covariance)?;
        arrays::owned(x.py(), &[SigmaPoints::count(n), n], points)
    }
    fn __repr__(&self) -> String {
        let SigmaPoints { alpha, beta, kappa } = self.points;
        format!("MerweScaledSigmaPoints(n={}, alpha={alpha}, beta={beta}, kappa={kappa})", self.n)
    }
    fn __getnewargs__(&self) -> (usize, f64, f64, f64) {
        (self.n, self.points.alpha, self.points.beta, self.points.kappa)
    }
}
