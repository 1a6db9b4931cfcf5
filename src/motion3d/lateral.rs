//! A translation along the image plane without a rotation: section 5 of the paper, where one angle is unknown
//! and everything has a closed form.
//!
//! With `u = (cos psi, sin psi, 0)` the flow is `f_k = nu_k u` with noise. Any weights `mean + a (m_k -
//! mean)` of the parts `m_k = f_k . u` along the direction make the estimating equation `sum weight_k (f_k
//! across u) = 0` the principal axis of `F F^t / n + a (sum f f^t - F F^t / n)`, `F = sum f`: `a = 1` for
//! maximum likelihood (28), 0 for weights of 1 (30), `tau^2 / (tau^2 + sigma^2)` with the scatter `tau^2` of
//! the depths for shrunk ones. The variance is `sigma^2 (mean^2 + a^2 (tau^2 + sigma^2)) / (n (mean^2 + a
//! tau^2)^2)`.

use super::{model::input::check_noise_std, model::input::refuse_if};
use crate::error::{Error, Result};
use nalgebra::{Matrix2, Vector2};

/// Times that the scatter of depths is computed along the direction found with the one before.
const ROUNDS: usize = 8;

/// What the flow across the direction is weighed with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LateralWeights {
    /// Depths shrunk to their mean by what noise leaves of their scatter: never worse than the others.
    #[default]
    Shrunk,
    /// Each point's own depth: maximum likelihood (28), the principal axis of `sum f f^t`.
    Likelihood,
    /// The same for all: (30), the angle of `sum f`.
    Ones,
}

/// What section 5 of the paper says of known depths: variances of the angle `psi`, rad^2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LateralBound {
    /// The Cramér-Rao bound `sigma^2 / (n m2)`, `m2 = mean nu^2`.
    pub bound: f64,
    /// Maximum likelihood `sigma^2 / (n m2) + sigma^4 / (n m2^2)` (29).
    pub likelihood: f64,
    /// Weights of 1: `sigma^2 / (n mean(nu)^2)` (31); infinite where depths cancel.
    pub ones: f64,
    /// Shrunk weights `sigma^2 / (n [mean^2 + var^2 / (var + sigma^2)])`.
    pub shrunk: f64,
    /// Noise above which weights of 1 beat maximum likelihood, `sqrt(m2) std(nu) / |mean nu|`, in the unit of
    /// the flow.
    pub crossover: f64,
}

/// A direction along the image plane.
#[derive(Debug, Clone, PartialEq)]
pub struct LateralEstimate {
    /// `psi` of `u = (cos psi, sin psi, 0)`, rad, of the scene relative to the camera; depths are positive,
    /// most of them.
    pub angle: f64,
    /// Variance of `angle`, rad^2: (29), (31) or that of shrunk weights, with the moments of the depths less
    /// their noise; infinite where noise explains all flow.
    pub variance: f64,
    /// The Cramér-Rao bound with the same moments, rad^2.
    pub bound: f64,
    /// Standard deviation of each component of the flow: as given, else estimated.
    pub noise_std: f64,
    /// Inverse depths (N), the flow along the direction, in units of `|u|` per frame; their standard
    /// deviation is `noise_std`. NaN where the flow is not finite.
    pub inverse_depth: Vec<f64>,
}

/// First two moments of N inverse depths: square of the mean, scatter `tau^2` about it; and the variance of
/// the flow's noise.
#[derive(Debug, Clone, Copy)]
struct Moments {
    n: f64,
    squared_mean: f64,
    scatter: f64,
    noise: f64,
}

impl Moments {
    /// `a` of the weights `mean + a (m - mean)`.
    fn share(&self, weights: LateralWeights) -> f64 {
        match weights {
            LateralWeights::Likelihood => 1.0,
            LateralWeights::Ones => 0.0,
            LateralWeights::Shrunk => self.scatter / (self.scatter + self.noise).max(f64::MIN_POSITIVE),
        }
    }

    /// Variance of the angle.
    fn variance(&self, weights: LateralWeights) -> f64 {
        let (a, Self { n, squared_mean, scatter, noise }) = (self.share(weights), *self);
        let slope = squared_mean + a * scatter;
        if slope > 0.0 {
            noise * (squared_mean + a * a * (scatter + noise)) / (n * slope * slope)
        } else {
            f64::INFINITY
        }
    }

    fn bound(&self) -> f64 {
        self.noise / (self.n * (self.squared_mean + self.scatter))
    }
}

/// Sums over the flow: `n`, `sum f`, `sum f f^t`.
#[derive(Debug, Clone, Copy)]
struct Sums {
    n: f64,
    first: Vector2<f64>,
    second: Matrix2<f64>,
}

impl Sums {
    fn of(flow: impl Iterator<Item = [f64; 2]>) -> Self {
        let mut sums = Self { n: 0.0, first: Vector2::zeros(), second: Matrix2::zeros() };
        for f in flow.filter(is_finite).map(Vector2::from) {
            sums.n += 1.0;
            sums.first += f;
            sums.second += f * f.transpose();
        }
        sums
    }

    /// Scatter matrix about the mean.
    fn about_mean(&self) -> Matrix2<f64> {
        self.second - self.first * self.first.transpose() / self.n
    }

    /// The principal axis of `F F^t / n + a (sum f f^t - F F^t / n)`, with most depths positive; `None` where
    /// all of that is zero.
    fn axis(&self, a: f64) -> Option<Vector2<f64>> {
        let q = self.second - (1.0 - a) * self.about_mean();
        let angle = 0.5 * (q[(0, 1)] + q[(1, 0)]).atan2(q[(0, 0)] - q[(1, 1)]);
        let axis = Vector2::new(angle.cos(), angle.sin());
        (q.trace() > 0.0).then(|| if axis.dot(&self.first) < 0.0 { -axis } else { axis })
    }

    /// Moments of the depths along a direction without what noise adds; its variance is that across, where it
    /// is not given.
    fn moments(&self, u: &Vector2<f64>, noise: Option<f64>) -> Moments {
        let (n, across) = (self.n, Vector2::new(-u.y, u.x));
        let noise = noise.unwrap_or_else(|| (across.dot(&(self.second * across)) / (n - 1.0)).max(0.0));
        let mean = self.first.dot(u) / n;
        let scatter = (u.dot(&(self.about_mean() * u)) - (n - 1.0) * noise) / n;
        Moments { n, squared_mean: (mean * mean - noise / n).max(0.0), scatter: scatter.max(0.0), noise }
    }
}

fn is_finite(flow: &[f64; 2]) -> bool {
    flow.iter().all(|value| value.is_finite())
}

/// The direction of a translation along the image plane (`u_z = 0`) of a camera that does not turn, from flow
/// at N points wherever they are.
///
/// `flow`: per frame on the plane at distance 1, or px/frame of a camera with square pixels; each component
/// has the standard deviation `noise_std`, which is estimated from the flow across the direction where it is
/// `None`. Flow that is not finite is left out. (29) and (31) are of first order: they hold while they are
/// small beside a radian.
///
/// # Errors
/// [`Error::Argument`] for a `noise_std` that is none and for a `flow` of fewer than two finite vectors (one
/// where `noise_std` is known); [`Error::NotObservable`] when all of the flow, or with weights of 1 its sum,
/// is zero.
pub fn estimate_lateral(flow: &[[f64; 2]], noise_std: Option<f64>, weights: LateralWeights) -> Result<LateralEstimate> {
    noise_std.map_or(Ok(()), check_noise_std)?;
    let sums = Sums::of(flow.iter().copied());
    let least = if noise_std.is_some() { 1.0 } else { 2.0 };
    refuse_if(sums.n < least, "flow", format!("at least {least} finite vectors"), sums.n)?;
    let is_finite_sum = sums.second.iter().all(|sum| sum.is_finite());
    refuse_if(!is_finite_sum, "flow", "values whose squares are finite", "larger ones")?;
    let moments = |u: &Vector2<f64>| sums.moments(u, noise_std.map(|noise_std| noise_std * noise_std));
    let next = |u: Vector2<f64>| sums.axis(moments(&u).share(weights));
    let found = (0..ROUNDS).try_fold(Vector2::x(), |u, round| if round == 0 { sums.axis(1.0) } else { next(u) });
    let Some(u) = found else {
        return Err(Error::NotObservable("flow that is zero in sum has no direction".into()));
    };
    let moments = moments(&u);
    Ok(LateralEstimate {
        angle: u.y.atan2(u.x),
        variance: moments.variance(weights),
        bound: moments.bound(),
        noise_std: moments.noise.sqrt(),
        inverse_depth: flow.iter().map(|&f| if is_finite(&f) { u.dot(&Vector2::from(f)) } else { f64::NAN }).collect(),
    })
}

/// What any estimator, and each of those of [`estimate_lateral`], makes of points with these true inverse
/// depths: for the design of an experiment.
///
/// `inverse_depth`: `nu` (N) in units of `|u|` per frame; those that are not finite are left out.
/// `noise_std`: standard deviation of each component of the flow, in the same unit.
///
/// # Errors
/// [`Error::Argument`] for a `noise_std` that is none, and an `inverse_depth` without a finite value;
/// [`Error::NotObservable`] when all are zero.
pub fn lateral_bound(inverse_depth: &[f64], noise_std: f64) -> Result<LateralBound> {
    check_noise_std(noise_std)?;
    let sums = Sums::of(inverse_depth.iter().map(|&nu| [nu, 0.0]));
    refuse_if(sums.n == 0.0, "inv_depth", "at least one finite value", "none")?;
    if sums.second.trace() == 0.0 {
        return Err(Error::NotObservable("points that are infinitely far do not show a translation".into()));
    }
    let moments = Moments { noise: noise_std * noise_std, ..sums.moments(&Vector2::x(), Some(0.0)) };
    Ok(LateralBound {
        bound: moments.bound(),
        likelihood: moments.variance(LateralWeights::Likelihood),
        ones: moments.variance(LateralWeights::Ones),
        shrunk: moments.variance(LateralWeights::Shrunk),
        crossover: ((1.0 + moments.scatter / moments.squared_mean) * moments.scatter).sqrt(),
    })
}
