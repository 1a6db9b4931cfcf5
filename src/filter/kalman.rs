//! The linear filter (R. E. Kalman, "A new approach to linear filtering and prediction problems", 1960).

use super::state::{GaussianState, check_matrix, check_measurement, expect, reach_state, shared};
use crate::error::Result;
use crate::math::dense::multiply;

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
    /// and matrices that are no covariances; [`Error::Numerical`](crate::Error::Numerical) when the state
    /// outgrows all numbers.
    pub fn predict(&mut self) -> Result<()> {
        self.check()?;
        let n = self.dim_x;
        expect("F", &self.F, &[n * n, self.batch * n * n])?;
        check_matrix("F", &self.F)?;
        let mut next = vec![0.0; n];
        for item in 0..self.state.batch {
            let x = &mut self.state.x[item * n..(item + 1) * n];
            multiply(shared(&self.F, item, n * n), x, n, &mut next);
            x.copy_from_slice(&next);
        }
        self.state.propagate_covariance(&self.F)
    }

    /// Takes in the measurements `z` `(B, m)`; a state with a NaN among its numbers is left as it is.
    ///
    /// # Errors
    /// As [`predict`](Self::predict); also [`Error::Numerical`](crate::Error::Numerical) when `S` is not
    /// positive definite.
    pub fn update(&mut self, z: &[f64]) -> Result<()> {
        self.check()?;
        let (n, m) = (self.dim_x, self.dim_z);
        expect("z", z, &[self.batch * m])?;
        expect("H", &self.H, &[m * n, self.batch * m * n])?;
        check_matrix("H", &self.H)?;
        check_measurement(z)?;
        let mut predicted = vec![0.0; self.batch * m];
        for (item, predicted) in predicted.chunks_exact_mut(m).enumerate() {
            multiply(shared(&self.H, item, m * n), &self.state.x[item * n..(item + 1) * n], n, predicted);
        }
        self.state.update_all(z, &predicted, &self.H)
    }
}

reach_state!(KalmanFilter);
