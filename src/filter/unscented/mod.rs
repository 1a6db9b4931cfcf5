//! The unscented filter (S. Julier, J. Uhlmann, "Unscented filtering and nonlinear estimation", 2004).
//!
//! `points` draws the sigma points, `smoother` smooths.

mod points;
mod smoother;

use crate::error::Result;
use crate::filter::checks::shared;
use crate::filter::failures::Failures;
use crate::filter::manifold::{Manifold, Vectors};
use crate::filter::moments::{Moments, Of, moments, tile, weighted_product};
use crate::filter::sigma_points::SigmaPoints;
use crate::filter::state::{GaussianState, reach_state};
use crate::filter::update::Measured;
use crate::math::dense::{add_gram, forward, symmetrise};

/// A batch of unscented Kalman filters: `x' = f(x) + w` (or `f(x, w)`), `z = h(x) + v`.
///
/// A callback receives sigma points as rows, `(B (2 n + 1), n)`: those of one state follow each other, the
/// mean first, then `+`, then `-` in the order of the Cholesky factor's columns; it fills as many rows of `n`
/// or `m` values. Errors of a callback are passed on and leave `x` and `P` as they were; a state for which
/// its results are not finite is marked in `failed`. The fields of [`GaussianState`] (`x`, `P`, `Q`, `R`,
/// `y`, `S`, `K`, ...) are reached directly. Methods that end in `_on` take differences, means and sums of
/// one's own.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct UnscentedFilter {
    /// The batch of Gaussians and the noise.
    pub state: GaussianState,
    /// Constants of the sigma points.
    pub points: SigmaPoints,
    /// Draw new sigma points for the measurement, from `x` and `P` after the prediction (default). Otherwise
    /// the propagated ones are measured, as `filterpy` 1 did, which leaves `Q` out of the innovation
    /// covariance of additive-noise filters.
    pub redraw: bool,
    /// The propagated points `(B, rows, n)` of the last prediction; empty before the first.
    pub sigmas: Vec<f64>,
}

impl UnscentedFilter {
    /// `batch` filters with `dim_x` state and `dim_z` measurement dimensions.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) when a dimension is zero or the constants do not fit
    /// `dim_x`.
    pub fn new(batch: usize, dim_x: usize, dim_z: usize, points: SigmaPoints) -> Result<Self> {
        let state = GaussianState::new(batch, dim_x, dim_z)?;
        points.check(dim_x)?;
        Ok(Self { state, points, redraw: true, sigmas: Vec::new() })
    }

    /// Additive noise: the `2 n + 1` points go through `fx`, and `Q` is added to their covariance.
    ///
    /// # Errors
    /// Those of `fx`; [`Error::Argument`](crate::Error::Argument) for arrays of wrong length or when no
    /// state has finite results; [`Error::Numerical`](crate::Error::Numerical) when every state outgrows
    /// all numbers.
    pub fn predict(&mut self, fx: impl FnMut(&[f64], &mut [f64]) -> Result<()>) -> Result<()> {
        self.predict_on(&mut Vectors, fx)
    }

    /// As [`predict`](Self::predict), with `x_mean` and `residual_x` of `manifold`.
    ///
    /// # Errors
    /// Those of `manifold` too.
    pub fn predict_on<M: Manifold>(
        &mut self,
        manifold: &mut M,
        mut fx: impl FnMut(&[f64], &mut [f64]) -> Result<()>,
    ) -> Result<()> {
        self.check()?;
        self.points.check(self.dim_x)?;
        let (drawn, mut failures) = (self.draw()?, Failures::none(self.batch));
        let mut sigmas = vec![0.0; drawn.len()];
        fx(&drawn, &mut sigmas)?;
        failures.add_infinite("fx", &mut sigmas)?;
        let moments = self.moments_x(manifold, &sigmas, self.dim_x)?;
        let noise = self.Q.clone();
        self.finish_prediction(sigmas, moments, Some(&noise), failures)
    }

    /// Augmented noise: `4 n + 1` points of the state with its noise `w ~ N(0, Q)`; `fx` receives the state
    /// rows and the noise rows, `(B (4 n + 1), n)` each. `Q` may be singular.
    ///
    /// # Errors
    /// As [`predict`](Self::predict).
    pub fn predict_augmented(&mut self, fx: impl FnMut(&[f64], &[f64], &mut [f64]) -> Result<()>) -> Result<()> {
        self.predict_augmented_on(&mut Vectors, fx)
    }

    /// As [`predict_augmented`](Self::predict_augmented), with `x_mean` and `residual_x` of `manifold`.
    ///
    /// # Errors
    /// Those of `manifold` too.
    pub fn predict_augmented_on<M: Manifold>(
        &mut self,
        manifold: &mut M,
        mut fx: impl FnMut(&[f64], &[f64], &mut [f64]) -> Result<()>,
    ) -> Result<()> {
        self.check()?;
        self.points.check(2 * self.dim_x)?;
        let (roots, mut failures) = (self.state.roots()?, Failures::none(self.batch));
        let (states, noises) = self.draw_augmented(&self.x, &roots, &self.Q)?;
        let mut sigmas = vec![0.0; states.len()];
        fx(&states, &noises, &mut sigmas)?;
        failures.add_infinite("fx", &mut sigmas)?;
        let moments = self.moments_x(manifold, &sigmas, 2 * self.dim_x)?;
        self.finish_prediction(sigmas, moments, None, failures)
    }

    /// Takes in the measurements `z` `(B, m)` through `hx`: of each state the components that are not NaN.
    ///
    /// # Errors
    /// Those of `hx`; [`Error::Argument`](crate::Error::Argument) for arrays of wrong length or when no
    /// state has finite results; [`Error::Numerical`](crate::Error::Numerical) when no state has a
    /// positive definite innovation covariance.
    pub fn update(&mut self, z: &[f64], hx: impl FnMut(&[f64], &mut [f64]) -> Result<()>) -> Result<()> {
        self.update_on(&mut Vectors, z, hx)
    }

    /// As [`update`](Self::update), with differences, means and sums of `manifold`.
    ///
    /// # Errors
    /// Those of `manifold` too.
    pub fn update_on<M: Manifold>(
        &mut self,
        manifold: &mut M,
        z: &[f64],
        mut hx: impl FnMut(&[f64], &mut [f64]) -> Result<()>,
    ) -> Result<()> {
        self.check()?;
        self.points.check(self.dim_x)?;
        let (n, m, batch) = (self.dim_x, self.dim_z, self.batch);
        let (roots, mut failures) = (self.state.roots()?, Failures::none(batch));
        let is_new = self.redraw || self.sigmas.is_empty();
        let sigmas = if is_new { self.draw_from(&self.x, &roots) } else { self.sigmas.clone() };
        let rows = sigmas.len() / (batch * n);
        let mut measured = vec![0.0; batch * rows * m];
        hx(&sigmas, &mut measured)?;
        failures.add_infinite("hx", &mut measured)?;
        let dims = (rows - 1) / 2;
        let moments = moments(&self.points, manifold, Of::Measurements, &measured, (dims, m))?;
        let Moments { mean, deviations, odd: mut seen, even: mut noise } = moments;
        if !is_new {
            // The points do not spread as P does: H L = P_zx L^-T, and what H does not explain is noise.
            let x = tile(&self.x, n, rows);
            let mut from_x = vec![0.0; sigmas.len()];
            manifold.residual_x(&sigmas, &x, &mut from_x)?;
            let weights = self.points.covariance_weights(dims);
            seen = vec![0.0; batch * m * n];
            for item in 0..batch {
                let z = &deviations[item * rows * m..(item + 1) * rows * m];
                let seen = &mut seen[item * m * n..(item + 1) * m * n];
                seen.copy_from_slice(&weighted_product(z, &from_x[item * rows * n..(item + 1) * rows * n], &weights));
                seen.chunks_exact_mut(n).for_each(|row| forward(&roots[item * n * n..(item + 1) * n * n], n, row));
                let mut explained = vec![0.0; m * m];
                add_gram(seen, n, &mut explained);
                let spread = weighted_product(z, z, &weights);
                let noise = &mut noise[item * m * m..(item + 1) * m * m];
                noise.iter_mut().zip(spread).zip(explained).for_each(|((noise, s), e)| *noise = s - e);
            }
        }
        for (item, noise) in noise.chunks_exact_mut(m * m).enumerate() {
            noise.iter_mut().zip(shared(&self.R, item, m * m)).for_each(|(noise, r)| *noise += r);
            symmetrise(noise, m);
        }
        let measured = Measured { roots: &roots, seen: &seen, noise: &noise, predicted: &mean };
        self.state.take_in(z, &measured, manifold, failures)
    }

    /// The sigma points `(B, 2 n + 1, n)` of the present `x` and `P`.
    ///
    /// # Errors
    /// [`Error::Numerical`](crate::Error::Numerical) when a covariance cannot be repaired.
    pub fn draw(&mut self) -> Result<Vec<f64>> {
        let roots = self.state.roots()?;
        Ok(self.draw_from(&self.x, &roots))
    }

    pub(super) fn moments_x<M: Manifold>(&self, manifold: &mut M, sigmas: &[f64], dims: usize) -> Result<Moments> {
        moments(&self.points, manifold, Of::States, sigmas, (dims, self.dim_x))
    }

    /// Sets `x` and `P` to the moments of propagated points, plus additive noise.
    fn finish_prediction(
        &mut self,
        sigmas: Vec<f64>,
        moments: Moments,
        noise: Option<&[f64]>,
        mut failures: Failures,
    ) -> Result<()> {
        let n = self.dim_x;
        let Moments { mut mean, odd, even: mut P, .. } = moments;
        failures.add_infinite("x_mean", &mut mean)?;
        let width = odd.len() / (self.batch * n);
        for (item, (P, odd)) in P.chunks_exact_mut(n * n).zip(odd.chunks_exact(n * width)).enumerate() {
            if let Some(noise) = noise {
                P.iter_mut().zip(shared(noise, item, n * n)).for_each(|(p, q)| *p += q);
            }
            symmetrise(P, n);
            add_gram(odd, width, P);
        }
        self.state.finish(&mean, &mut P, failures, |_| true)?;
        self.sigmas = sigmas;
        Ok(())
    }
}

reach_state!(UnscentedFilter);
