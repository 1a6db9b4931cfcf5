//! What every filter here holds: a batch of Gaussians, the noise, and the last update's by-products.

use super::checks::{check_batch, check_covariances, check_dimension, check_mean, expect};
use super::failures::Failures;
use crate::error::{Error, Result};
use crate::math::dense::covariance_root;

/// A batch of `B` independent Gaussian states, `n` dimensions, `m` measured numbers; row-major arrays.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GaussianState {
    /// `B`, the number of states.
    pub batch: usize,
    /// `n`, dimensions of the state.
    pub dim_x: usize,
    /// `m`, dimensions of the measurement.
    pub dim_z: usize,
    /// Means `(B, n)`; zero at first.
    pub x: Vec<f64>,
    /// Covariances `(B, n, n)`; identity at first.
    pub P: Vec<f64>,
    /// Process noise, `(n, n)` for every state or `(B, n, n)`; identity at first.
    pub Q: Vec<f64>,
    /// Measurement noise, `(m, m)` for every state or `(B, m, m)`; identity at first.
    pub R: Vec<f64>,
    /// Residual (innovation) of the last update, `(B, m)`; zero where a component was missing.
    pub y: Vec<f64>,
    /// Covariance of the residual, `(B, m, m)`; zero where a component was missing.
    pub S: Vec<f64>,
    /// Gain, `(B, n, m)`; zero where a component was missing.
    pub K: Vec<f64>,
    /// `log N(y; 0, S)` of the last update's measured components, `(B)`; zero without any.
    pub log_likelihood: Vec<f64>,
    /// Mahalanobis distance `sqrt(y^T S^-1 y)` of the last measurement, `(B)`; zero without any.
    pub mahalanobis: Vec<f64>,
    /// Whether a step could not be carried out for a state, `(B)`: the state was left as it was before that
    /// step. Never reset by a step.
    pub failed: Vec<bool>,
    /// How often a covariance had lost its positive definiteness and was repaired.
    pub repairs: u64,
}

impl GaussianState {
    /// `batch` states of `dim_x` dimensions with zero mean and identity covariances.
    ///
    /// # Errors
    /// [`Error::Argument`] when a dimension is zero or above 4096, or when the memory that `batch` states
    /// take in a step cannot be had.
    pub fn new(batch: usize, dim_x: usize, dim_z: usize) -> Result<Self> {
        check_dimension("dim_x", dim_x)?;
        check_dimension("dim_z", dim_z)?;
        check_batch(batch, dim_x, dim_z)?;
        let identity = |n: usize| (0..n * n).map(|k| f64::from(u8::from(k % (n + 1) == 0))).collect::<Vec<_>>();
        Ok(Self {
            batch,
            dim_x,
            dim_z,
            x: vec![0.0; batch * dim_x],
            P: identity(dim_x).repeat(batch),
            Q: identity(dim_x),
            R: identity(dim_z),
            y: vec![0.0; batch * dim_z],
            S: vec![0.0; batch * dim_z * dim_z],
            K: vec![0.0; batch * dim_x * dim_z],
            log_likelihood: vec![0.0; batch],
            mahalanobis: vec![0.0; batch],
            failed: vec![false; batch],
            repairs: 0,
        })
    }

    /// Checks sizes and values of the public arrays, which a caller may have replaced.
    pub(super) fn check(&self) -> Result<()> {
        let (b, n, m) = (self.batch, self.dim_x, self.dim_z);
        expect("x", &self.x, &[b * n])?;
        expect("P", &self.P, &[b * n * n])?;
        expect("Q", &self.Q, &[n * n, b * n * n])?;
        expect("R", &self.R, &[m * m, b * m * m])?;
        check_mean(&self.x)?;
        check_covariances("P", &self.P, n)?;
        check_covariances("Q", &self.Q, n)?;
        check_covariances("R", &self.R, m)
    }

    /// The lower roots `(B, n, n)` of every covariance; repairs those that need it.
    pub(super) fn roots(&mut self) -> Result<Vec<f64>> {
        let (roots, repairs) = roots(&mut self.P, self.dim_x)?;
        self.repairs += repairs;
        Ok(roots)
    }

    /// Ends a step: replaces `x` and `P` of every state that made it and marks the others. `moved` says which
    /// states the step was for.
    ///
    /// # Errors
    /// [`Error::Numerical`] or what else made the first state fail, when all did; nothing changes then.
    pub(super) fn finish(
        &mut self,
        x: &[f64],
        P: &mut [f64],
        mut failures: Failures,
        moved: impl Fn(usize) -> bool,
    ) -> Result<()> {
        let n = self.dim_x;
        let (mut repairs, mut root) = (0, vec![0.0; n * n]);
        for (item, (x, P)) in x.chunks_exact(n).zip(P.chunks_exact_mut(n * n)).enumerate() {
            if !moved(item) || failures.has(item) {
                continue;
            }
            if x.iter().chain(&*P).any(|v| !v.is_finite()) {
                let reason = format!("x or P of state {item} has outgrown the range of numbers");
                failures.add(item, Error::Numerical(reason));
                continue;
            }
            if let Some(repaired) = covariance_root(P, n, &mut root) {
                repairs += u64::from(repaired);
            } else {
                let reason = format!("P of state {item} has no positive semi-definite repair");
                failures.add(item, Error::Numerical(reason));
            }
        }
        failures.check()?;
        self.repairs += repairs;
        for item in 0..self.batch {
            if failures.has(item) {
                self.failed[item] = true;
                self.skip(item);
            } else if moved(item) {
                self.x[item * n..(item + 1) * n].copy_from_slice(&x[item * n..(item + 1) * n]);
                let all = item * n * n..(item + 1) * n * n;
                self.P[all.clone()].copy_from_slice(&P[all]);
            }
        }
        Ok(())
    }

    /// Clears the by-products of a state without a measurement.
    pub(super) fn skip(&mut self, item: usize) {
        let (n, m) = (self.dim_x, self.dim_z);
        self.y[item * m..(item + 1) * m].fill(0.0);
        self.S[item * m * m..(item + 1) * m * m].fill(0.0);
        self.K[item * n * m..(item + 1) * n * m].fill(0.0);
        (self.log_likelihood[item], self.mahalanobis[item]) = (0.0, 0.0);
    }
}

/// The lower roots of covariances `(n, n)`, which are repaired where they must be, and how many were.
pub(super) fn roots(P: &mut [f64], n: usize) -> Result<(Vec<f64>, u64)> {
    let (mut roots, mut repairs) = (vec![0.0; P.len()], 0);
    for (item, (p, l)) in P.chunks_exact_mut(n * n).zip(roots.chunks_exact_mut(n * n)).enumerate() {
        let reason = || Error::Numerical(format!("P of state {item} has no positive semi-definite repair"));
        repairs += u64::from(covariance_root(p, n, l).ok_or_else(reason)?);
    }
    Ok((roots, repairs))
}

/// The fields of the state are reached from the filter directly.
macro_rules! reach_state {
    ($filter:ty) => {
        impl std::ops::Deref for $filter {
            type Target = GaussianState;
            fn deref(&self) -> &GaussianState {
                &self.state
            }
        }
        impl std::ops::DerefMut for $filter {
            fn deref_mut(&mut self) -> &mut GaussianState {
                &mut self.state
            }
        }
    };
}
pub(super) use reach_state;
