//! Prediction: every particle moves by the transition and its noise.

use super::{noise::roots, state::ParticleFilter, state::Purpose};
use crate::error::{Error, Result};
use crate::filter::checks::{check_covariances, check_finite, expect, finite, shared};
use crate::math::dense::multiply_transposed;

impl ParticleFilter {
    /// Moves all particles by `transition(x, next)`, arrays `(B, N, n)`, and adds Gaussian noise of
    /// covariance `noise` `(n, n)` or `(B, n, n)`.
    ///
    /// Without `noise` the transition must be random itself, by [`Self::standard_normal`].
    ///
    /// # Errors
    /// The transition's own, [`Error::Argument`] naming `transition` for results that are not finite, or `Q`
    /// where it is no covariance. The particles are then as before.
    pub fn predict(
        &mut self,
        transition: impl FnOnce(&[f64], &mut [f64]) -> Result<()>,
        noise: Option<&[f64]>,
    ) -> Result<()> {
        self.check()?;
        let n = self.dim_x;
        let roots = noise.map(|noise| self.noise_roots(noise)).transpose()?;
        let mut next = vec![0.0; self.x.len()];
        transition(&self.x, &mut next)?;
        finite("transition", &next)?;
        if let Some(roots) = roots {
            self.for_each_particle(Purpose::Transition, &mut next, |set, _, normal, next| {
                add_product(shared(&roots, set, n * n), normal, next);
            });
        }
        self.take_over(next)
    }

    /// `x <- F x + w`, `w ~ N(0, Q)`, with `f` and `q` `(n, n)` for every set or `(B, n, n)`.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `F` or `Q` for wrong sizes, values that are not finite, or no covariance;
    /// [`Error::Numerical`] when particles become infinite. The particles are then as before.
    pub fn predict_linear(&mut self, f: &[f64], q: &[f64]) -> Result<()> {
        self.check()?;
        let n = self.dim_x;
        expect("F", f, &[n * n, self.batch * n * n])?;
        check_finite("F", f)?;
        let roots = self.noise_roots(q)?;
        let mut next = vec![0.0; self.x.len()];
        let x = &self.x;
        self.for_each_particle(Purpose::Transition, &mut next, |set, row, normal, next| {
            let (f, root) = (shared(f, set, n * n), shared(&roots, set, n * n));
            multiply_transposed(&x[row * n..(row + 1) * n], f, n, next);
            add_product(root, normal, next);
        });
        self.take_over(next)
    }

    /// The standard normals `(B, N, n)` that the next prediction's noise is made of.
    pub fn standard_normal(&self) -> Result<Vec<f64>> {
        self.check()?;
        let mut all = vec![0.0; self.x.len()];
        self.for_each_particle(Purpose::Transition, &mut all, |_, _, normal, out| out.copy_from_slice(normal));
        Ok(all)
    }

    fn noise_roots(&self, q: &[f64]) -> Result<Vec<f64>> {
        let n = self.dim_x;
        expect("Q", q, &[n * n, self.batch * n * n])?;
        check_covariances("Q", q, n)?;
        Ok(roots(q, n))
    }

    fn take_over(&mut self, next: Vec<f64>) -> Result<()> {
        if let Some(at) = next.iter().position(|v| !v.is_finite()) {
            let set = at / (self.dim_x * self.particles());
            return Err(Error::Numerical(format!("x of set {set} has outgrown the range of numbers")));
        }
        self.x = next;
        self.step += 1;
        self.selections = 0;
        Ok(())
    }
}

/// `next += root normal`.
fn add_product(root: &[f64], normal: &[f64], next: &mut [f64]) {
    for (next, row) in next.iter_mut().zip(root.chunks_exact(normal.len())) {
        *next += row.iter().zip(normal).map(|(a, b)| a * b).sum::<f64>();
    }
}
