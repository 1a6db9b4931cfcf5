//! The linear filter (R. E. Kalman, "A new approach to linear filtering and prediction problems", 1960),
//! and its update by one number.

use super::checks::{check_finite, expect, shared};
use super::failures::Failures;
use super::manifold::{Manifold, Vectors};
use super::smoother::{Smoothed, Transition, smooth};
use super::state::{GaussianState, reach_state};
use super::update::Measured;
use crate::error::Result;
use crate::math::dense::multiply;
use nalgebra::{RowSVector, SMatrix, SVector};

/// A batch of linear Kalman filters: `x' = F x + w`, `z = H x + v`, `w ~ N(0, Q)`, `v ~ N(0, R)`.
///
/// The fields of [`GaussianState`] (`x`, `P`, `Q`, `R`, `y`, `S`, `K`, ...) are reached directly.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct KalmanFilter {
    /// The batch of Gaussians and the noise.
    pub state: GaussianState,
    /// Transition, `(n, n)` for every state or `(B, n, n)`; identity at first.
    pub F: Vec<f64>,
    /// Measurement matrix, `(m, n)` for every state or `(B, m, n)`; zero at first.
    pub H: Vec<f64>,
}

impl KalmanFilter {
    /// `batch` filters with `dim_x` state and `dim_z` measurement dimensions.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) when a dimension is zero.
    pub fn new(batch: usize, dim_x: usize, dim_z: usize) -> Result<Self> {
        let state = GaussianState::new(batch, dim_x, dim_z)?;
        let F = state.Q.clone();
        Ok(Self { state, F, H: vec![0.0; dim_z * dim_x] })
    }

    /// `x <- F x`, `P <- F P F^T + Q`.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) for arrays of wrong length, numbers that are not finite
    /// and matrices that are no covariances; [`Error::Numerical`](crate::Error::Numerical) when every state
    /// outgrows all numbers (single ones are marked in `failed`).
    pub fn predict(&mut self) -> Result<()> {
        self.check()?;
        self.check_transition(&self.F)?;
        let x = self.moved(&self.x, &self.F);
        self.state.propagate(&x, &self.F, Failures::none(self.state.batch))
    }

    /// Takes in the measurements `z` `(B, m)`: of each state the components that are not NaN.
    ///
    /// # Errors
    /// As [`predict`](Self::predict); also [`Error::Numerical`](crate::Error::Numerical) when no state has a
    /// positive definite `S`.
    pub fn update(&mut self, z: &[f64]) -> Result<()> {
        self.update_on(&mut Vectors, z)
    }

    /// As [`update`](Self::update) with differences and sums of one's own (`residual_z`, `state_add`).
    ///
    /// # Errors
    /// Those of `manifold` too.
    pub fn update_on(&mut self, manifold: &mut impl Manifold, z: &[f64]) -> Result<()> {
        self.check()?;
        let (n, m, batch) = (self.dim_x, self.dim_z, self.batch);
        expect("H", &self.H, &[m * n, batch * m * n])?;
        check_finite("H", &self.H)?;
        let mut predicted = vec![0.0; batch * m];
        for (item, predicted) in predicted.chunks_exact_mut(m).enumerate() {
            multiply(shared(&self.H, item, m * n), &self.x[item * n..(item + 1) * n], n, predicted);
        }
        let roots = self.state.roots()?;
        let seen = times_roots(&self.H, &roots, (n, m));
        let noise = self.R.clone();
        let measured = Measured { roots: &roots, seen: &seen, noise: &noise, predicted: &predicted };
        self.state.take_in(z, &measured, manifold, Failures::none(batch))
    }

    /// Smooths a sequence of `T` filtered means `Xs` `(T, B, n)` and covariances `Ps` `(T, B, n, n)` (H.
    /// Rauch, F. Tung, C. Striebel, "Maximum likelihood estimates of linear dynamic systems", 1965). `Fs`
    /// and `Qs` are those of the step to each time, the first unused; without them the filter's own.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) for wrong lengths and values; those of `manifold`, of
    /// which `residual_x` and `state_add` are used.
    pub fn rts_smoother(
        &self,
        manifold: &mut impl Manifold,
        (Xs, Ps): (&[f64], &[f64]),
        Fs: Option<&[Vec<f64>]>,
        Qs: Option<&[Vec<f64>]>,
    ) -> Result<Smoothed> {
        let n = self.dim_x;
        smooth(&self.state, manifold, (Xs, Ps), Qs, |_, (k, _), x, roots| {
            let F = Fs.map_or(&self.F, |Fs| &Fs[k]);
            self.check_transition(F)?;
            Ok(Transition { mean: self.moved(x, F), seen: times_roots(F, roots, (n, n)), noise: None })
        })
    }

    fn check_transition(&self, F: &[f64]) -> Result<()> {
        let n = self.dim_x;
        expect("F", F, &[n * n, self.batch * n * n])?;
        check_finite("F", F)
    }

    fn moved(&self, x: &[f64], F: &[f64]) -> Vec<f64> {
        let n = self.dim_x;
        let mut next = vec![0.0; x.len()];
        for (item, (x, next)) in x.chunks_exact(n).zip(next.chunks_exact_mut(n)).enumerate() {
            multiply(shared(F, item, n * n), x, n, next);
        }
        next
    }
}

/// `A L` of each state, with `A` `(rows, n)` of all or `(B, rows, n)`.
pub(super) fn times_roots(A: &[f64], roots: &[f64], (n, rows): (usize, usize)) -> Vec<f64> {
    let mut out = vec![0.0; roots.len() / n * rows];
    for (item, (root, out)) in roots.chunks_exact(n * n).zip(out.chunks_exact_mut(rows * n)).enumerate() {
        multiply(shared(A, item, rows * n), root, n, out);
    }
    out
}

/// Updates state and covariance by a measurement `(z, r)`, value and variance, of `h x`, in Joseph form, for
/// small states of fixed size on the stack. Returns the normalised innovation squared. Independent
/// measurements may follow one another.
pub fn update_by_scalar<const N: usize>(
    x: &mut SVector<f64, N>,
    p: &mut SMatrix<f64, N, N>,
    h: &RowSVector<f64, N>,
    (z, r): (f64, f64),
) -> f64 {
    let innovation = z - (h * *x)[0];
    let s = (h * *p * h.transpose())[0] + r;
    let k = *p * h.transpose() / s;
    *x += k * innovation;
    let rest = SMatrix::<f64, N, N>::identity() - k * h;
    *p = rest * *p * rest.transpose() + k * k.transpose() * r;
    innovation * innovation / s
}

reach_state!(KalmanFilter);
