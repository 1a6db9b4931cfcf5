//! The extended filter: non-linear functions, linearised at the mean (A. H. Jazwinski, "Stochastic Processes
//! and Filtering Theory", 1970, chapter 8).

use super::{state::GaussianState, state::check_measurement, state::expect, state::finite, state::reach_state};
use crate::error::Result;

/// A batch of extended Kalman filters: `x' = f(x) + w`, `z = h(x) + v`.
///
/// Callbacks receive states as rows, `(rows, n)`, and fill `(rows, n)` or `(rows, m)` values; Jacobian
/// callbacks receive the `B` means and fill `(B, n, n)` or `(B, m, n)`. Errors of a callback are passed on
/// and leave the filter unchanged. The fields of [`GaussianState`] (`x`, `P`, `Q`, `R`, `y`, `S`, `K`, ...)
/// are reached directly.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ExtendedFilter {
    /// The batch of Gaussians and the noise.
    pub state: GaussianState,
    /// Step of the central differences, relative to `max(1, |x_k|)`; 1e-5 at first.
    pub step: f64,
}

impl ExtendedFilter {
    /// `batch` filters with `dim_x` state and `dim_z` measurement dimensions.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) when a dimension is zero.
    pub fn new(batch: usize, dim_x: usize, dim_z: usize) -> Result<Self> {
        Ok(Self { state: GaussianState::new(batch, dim_x, dim_z)?, step: 1e-5 })
    }

    /// `x <- f(x)`, `P <- F P F^T + Q` with `F = df/dx` at the old mean from `jacobian`.
    ///
    /// # Errors
    /// Those of the callbacks; [`Error::Argument`](crate::Error::Argument) for arrays of wrong length or
    /// callback results that are not finite.
    pub fn predict(
        &mut self,
        mut fx: impl FnMut(&[f64], &mut [f64]) -> Result<()>,
        jacobian: impl FnOnce(&[f64], &mut [f64]) -> Result<()>,
    ) -> Result<()> {
        self.check()?;
        let mut f = vec![0.0; self.P.len()];
        jacobian(&self.x, &mut f)?;
        finite("F", &f)?;
        let mut next = vec![0.0; self.x.len()];
        fx(&self.x, &mut next)?;
        finite("fx", &next)?;
        self.state.x = next;
        self.state.propagate_covariance(&f)
    }

    /// As [`predict`](Self::predict), with the Jacobian by central differences of `fx`.
    pub fn predict_by_differences(&mut self, mut fx: impl FnMut(&[f64], &mut [f64]) -> Result<()>) -> Result<()> {
        self.check()?;
        let f = self.differences(self.dim_x, &mut fx)?;
        self.predict(fx, |_, out| {
            out.copy_from_slice(&f);
            Ok(())
        })
    }

    /// Takes in the measurements `z` `(B, m)` through `hx` and its Jacobian; NaN means no measurement.
    ///
    /// # Errors
    /// Those of the callbacks; [`Error::Argument`](crate::Error::Argument) as for `predict`;
    /// [`Error::Numerical`](crate::Error::Numerical) when `S` is not positive definite.
    pub fn update(
        &mut self,
        z: &[f64],
        mut hx: impl FnMut(&[f64], &mut [f64]) -> Result<()>,
        jacobian: impl FnOnce(&[f64], &mut [f64]) -> Result<()>,
    ) -> Result<()> {
        self.check()?;
        let (n, m) = (self.dim_x, self.dim_z);
        expect("z", z, &[self.batch * m])?;
        check_measurement(z)?;
        let mut h = vec![0.0; self.batch * m * n];
        jacobian(&self.x, &mut h)?;
        finite("H", &h)?;
        let mut predicted = vec![0.0; self.batch * m];
        hx(&self.x, &mut predicted)?;
        finite("hx", &predicted)?;
        self.state.update_all(z, &predicted, &h)
    }

    /// As [`update`](Self::update), with the Jacobian by central differences.
    pub fn update_by_differences(
        &mut self,
        z: &[f64],
        mut hx: impl FnMut(&[f64], &mut [f64]) -> Result<()>,
    ) -> Result<()> {
        self.check()?;
        let h = self.differences(self.dim_z, &mut hx)?;
        self.update(z, hx, |_, out| {
            out.copy_from_slice(&h);
            Ok(())
        })
    }

    /// The Jacobians `(B, rows, n)` of a function with `rows` results, at every mean.
    fn differences(
        &self,
        rows: usize,
        function: &mut impl FnMut(&[f64], &mut [f64]) -> Result<()>,
    ) -> Result<Vec<f64>> {
        let n = self.dim_x;
        let mut points = Vec::with_capacity(self.batch * 2 * n * n);
        for x in self.x.chunks_exact(n) {
            for k in 0..n {
                for sign in [1.0, -1.0] {
                    let start = points.len();
                    points.extend_from_slice(x);
                    points[start + k] += sign * self.step * x[k].abs().max(1.0);
                }
            }
        }
        let mut values = vec![0.0; self.batch * 2 * n * rows];
        function(&points, &mut values)?;
        let mut jacobian = vec![0.0; self.batch * rows * n];
        for item in 0..self.batch {
            for k in 0..n {
                let plus = (item * n + k) * 2;
                let width = points[plus * n + k] - points[(plus + 1) * n + k];
                for row in 0..rows {
                    jacobian[(item * rows + row) * n + k] =
                        (values[plus * rows + row] - values[(plus + 1) * rows + row]) / width;
                }
            }
        }
        Ok(jacobian)
    }
}

reach_state!(ExtendedFilter);
