//! The extended filter: non-linear functions, linearised at the mean (A. H. Jazwinski, "Stochastic Processes
//! and Filtering Theory", 1970, chapter 8).

use super::failures::Failures;
use super::kalman::times_roots;
use super::manifold::{Manifold, Vectors};
use super::smoother::{Smoothed, Transition, smooth};
use super::state::{GaussianState, reach_state};
use super::update::Measured;
use crate::error::Result;

/// A batch of extended Kalman filters: `x' = f(x) + w`, `z = h(x) + v`.
///
/// Callbacks receive states as rows, `(rows, n)`, and fill `(rows, n)` or `(rows, m)` values; Jacobian
/// callbacks receive the `B` means and fill `(B, n, n)` or `(B, m, n)`. Errors of a callback are passed on
/// and leave the filter unchanged; a state for which its results are not finite is marked in `failed`. The
/// fields of [`GaussianState`] (`x`, `P`, `Q`, `R`, `y`, `S`, `K`, ...) are reached directly. Methods that
/// end in `_on` take differences and sums of one's own.
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
    /// when no state has finite results.
    pub fn predict(
        &mut self,
        mut fx: impl FnMut(&[f64], &mut [f64]) -> Result<()>,
        jacobian: impl FnOnce(&[f64], &mut [f64]) -> Result<()>,
    ) -> Result<()> {
        self.check()?;
        let mut failures = Failures::none(self.batch);
        let mut f = vec![0.0; self.P.len()];
        jacobian(&self.x, &mut f)?;
        failures.add_infinite("F", &mut f)?;
        let mut next = vec![0.0; self.x.len()];
        fx(&self.x, &mut next)?;
        failures.add_infinite("fx", &mut next)?;
        self.state.propagate(&next, &f, failures)
    }

    /// As [`predict`](Self::predict), with the Jacobian by central differences of `fx`.
    ///
    /// # Errors
    /// As [`predict`](Self::predict).
    pub fn predict_by_differences(&mut self, fx: impl FnMut(&[f64], &mut [f64]) -> Result<()>) -> Result<()> {
        self.predict_by_differences_on(&mut Vectors, fx)
    }

    /// As [`predict_by_differences`](Self::predict_by_differences), with `residual_x` of `manifold`.
    ///
    /// # Errors
    /// Those of `manifold` too.
    pub fn predict_by_differences_on(
        &mut self,
        manifold: &mut impl Manifold,
        mut fx: impl FnMut(&[f64], &mut [f64]) -> Result<()>,
    ) -> Result<()> {
        self.check()?;
        let f = self.differences(&self.x, self.dim_x, &mut fx, |a, b, out| manifold.residual_x(a, b, out))?;
        self.predict(fx, |_, out| {
            out.copy_from_slice(&f);
            Ok(())
        })
    }

    /// Takes in the measurements `z` `(B, m)` through `hx` and its Jacobian: of each state the components
    /// that are not NaN.
    ///
    /// # Errors
    /// Those of the callbacks; [`Error::Argument`](crate::Error::Argument) as for `predict`;
    /// [`Error::Numerical`](crate::Error::Numerical) when no state has a positive definite `S`.
    pub fn update(
        &mut self,
        z: &[f64],
        hx: impl FnMut(&[f64], &mut [f64]) -> Result<()>,
        jacobian: impl FnOnce(&[f64], &mut [f64]) -> Result<()>,
    ) -> Result<()> {
        self.update_on(&mut Vectors, z, hx, jacobian)
    }

    /// As [`update`](Self::update), with `residual_z` and `state_add` of `manifold`.
    ///
    /// # Errors
    /// Those of `manifold` too.
    pub fn update_on(
        &mut self,
        manifold: &mut impl Manifold,
        z: &[f64],
        mut hx: impl FnMut(&[f64], &mut [f64]) -> Result<()>,
        jacobian: impl FnOnce(&[f64], &mut [f64]) -> Result<()>,
    ) -> Result<()> {
        self.check()?;
        let (n, m) = (self.dim_x, self.dim_z);
        let mut failures = Failures::none(self.batch);
        let mut h = vec![0.0; self.batch * m * n];
        jacobian(&self.x, &mut h)?;
        failures.add_infinite("H", &mut h)?;
        let mut predicted = vec![0.0; self.batch * m];
        hx(&self.x, &mut predicted)?;
        failures.add_infinite("hx", &mut predicted)?;
        let roots = self.state.roots()?;
        let seen = times_roots(&h, &roots, (n, m));
        let noise = self.R.clone();
        let measured = Measured { roots: &roots, seen: &seen, noise: &noise, predicted: &predicted };
        self.state.take_in(z, &measured, manifold, failures)
    }

    /// As [`update`](Self::update), with the Jacobian by central differences.
    ///
    /// # Errors
    /// As [`update`](Self::update).
    pub fn update_by_differences(&mut self, z: &[f64], hx: impl FnMut(&[f64], &mut [f64]) -> Result<()>) -> Result<()> {
        self.update_by_differences_on(&mut Vectors, z, hx)
    }

    /// As [`update_by_differences`](Self::update_by_differences), with `residual_z` and `state_add` of
    /// `manifold`.
    ///
    /// # Errors
    /// Those of `manifold` too.
    pub fn update_by_differences_on(
        &mut self,
        manifold: &mut impl Manifold,
        z: &[f64],
        mut hx: impl FnMut(&[f64], &mut [f64]) -> Result<()>,
    ) -> Result<()> {
        self.check()?;
        let h = self.differences(&self.x, self.dim_z, &mut hx, |a, b, out| manifold.residual_z(a, b, out))?;
        self.update_on(manifold, z, hx, |_, out| {
            out.copy_from_slice(&h);
            Ok(())
        })
    }

    /// Smooths a sequence of `T` filtered means `Xs` `(T, B, n)` and covariances `Ps` `(T, B, n, n)`. `fx`
    /// and `jacobian` (`None`: central differences) get the number of the time to which they move the
    /// states; `Qs` are those of the step to each time, the first unused; without them the filter's own.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) for wrong lengths and values; those of the callbacks
    /// and of `manifold`, of which `residual_x` and `state_add` are used.
    pub fn rts_smoother<M: Manifold>(
        &self,
        manifold: &mut M,
        (Xs, Ps): (&[f64], &[f64]),
        Qs: Option<&[Vec<f64>]>,
        mut fx: impl FnMut(usize, &[f64], &mut [f64]) -> Result<()>,
        mut jacobian: Option<impl FnMut(usize, &[f64], &mut [f64]) -> Result<()>>,
    ) -> Result<Smoothed> {
        let n = self.dim_x;
        smooth(&self.state, manifold, (Xs, Ps), Qs, |manifold, (k, _), x, roots| {
            let mut mean = vec![0.0; x.len()];
            fx(k, x, &mut mean)?;
            let f = if let Some(jacobian) = &mut jacobian {
                let mut f = vec![0.0; roots.len()];
                jacobian(k, x, &mut f)?;
                f
            } else {
                let mut step = |points: &[f64], out: &mut [f64]| fx(k, points, out);
                self.differences(x, n, &mut step, |a, b, out| manifold.residual_x(a, b, out))?
            };
            Ok(Transition { mean, seen: times_roots(&f, roots, (n, n)), noise: None })
        })
    }

    /// The Jacobians `(B, rows, n)` of a function with `rows` results, at every mean.
    fn differences(
        &self,
        means: &[f64],
        rows: usize,
        function: &mut impl FnMut(&[f64], &mut [f64]) -> Result<()>,
        subtract: impl FnOnce(&[f64], &[f64], &mut [f64]) -> Result<()>,
    ) -> Result<Vec<f64>> {
        let n = self.dim_x;
        let mut points = Vec::with_capacity(self.batch * 2 * n * n);
        for x in means.chunks_exact(n) {
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
        // Of each state and direction the results at the greater and at the smaller point.
        let side = |from: usize| values.chunks_exact(rows).skip(from).step_by(2).flatten().copied();
        let (plus, minus): (Vec<f64>, Vec<f64>) = (side(0).collect(), side(1).collect());
        let mut change = vec![0.0; plus.len()];
        subtract(&plus, &minus, &mut change)?;
        let mut jacobian = vec![0.0; self.batch * rows * n];
        for item in 0..self.batch {
            for k in 0..n {
                let at = item * n + k;
                let width = points[2 * at * n + k] - points[(2 * at + 1) * n + k];
                for row in 0..rows {
                    jacobian[(item * rows + row) * n + k] = change[at * rows + row] / width;
                }
            }
        }
        Ok(jacobian)
    }
}

reach_state!(ExtendedFilter);
