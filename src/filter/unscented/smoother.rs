//! The smoother of the unscented filter (S. Sarkka, "Unscented Rauch-Tung-Striebel smoother", 2008).

use super::UnscentedFilter;
use crate::error::Result;
use crate::filter::checks::shared;
use crate::filter::manifold::Manifold;
use crate::filter::moments::Moments;
use crate::filter::smoother::{Smoothed, Transition, smooth};
use crate::math::dense::add_gram;

impl UnscentedFilter {
    /// Smooths a sequence of `T` filtered means `Xs` `(T, B, n)` and covariances `Ps` `(T, B, n, n)`. `fx`
    /// gets the number of the time to which the points move; `Qs` are those of the step to each time, the
    /// first unused; without them the filter's own.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) for wrong lengths and values; those of `fx` and
    /// `manifold`.
    pub fn rts_smoother<M: Manifold>(
        &self,
        manifold: &mut M,
        (Xs, Ps): (&[f64], &[f64]),
        Qs: Option<&[Vec<f64>]>,
        mut fx: impl FnMut(usize, &[f64], &mut [f64]) -> Result<()>,
    ) -> Result<Smoothed> {
        let n = self.dim_x;
        self.points.check(n)?;
        smooth(&self.state, manifold, (Xs, Ps), Qs, |manifold, (k, Q), x, roots| {
            let drawn = self.draw_from(x, roots);
            let mut sigmas = vec![0.0; drawn.len()];
            fx(k, &drawn, &mut sigmas)?;
            let Moments { mean, odd, mut even, .. } = self.moments_x(manifold, &sigmas, n)?;
            for (item, even) in even.chunks_exact_mut(n * n).enumerate() {
                even.iter_mut().zip(shared(Q, item, n * n)).for_each(|(even, q)| *even += q);
            }
            Ok(Transition { mean, seen: odd, noise: Some(even) })
        })
    }

    /// As [`rts_smoother`](Self::rts_smoother), with the noise part of the sigma points; see
    /// [`predict_augmented`](Self::predict_augmented).
    ///
    /// # Errors
    /// As [`rts_smoother`](Self::rts_smoother).
    pub fn rts_smoother_augmented<M: Manifold>(
        &self,
        manifold: &mut M,
        (Xs, Ps): (&[f64], &[f64]),
        Qs: Option<&[Vec<f64>]>,
        mut fx: impl FnMut(usize, &[f64], &[f64], &mut [f64]) -> Result<()>,
    ) -> Result<Smoothed> {
        let n = self.dim_x;
        self.points.check(2 * n)?;
        smooth(&self.state, manifold, (Xs, Ps), Qs, |manifold, (k, Q), x, roots| {
            let (states, noises) = self.draw_augmented(x, roots, Q)?;
            let mut sigmas = vec![0.0; states.len()];
            fx(k, &states, &noises, &mut sigmas)?;
            let Moments { mean, odd, mut even, .. } = self.moments_x(manifold, &sigmas, 2 * n)?;
            // The first n dimensions are the state's, the others the noise's.
            let part = |from: usize| odd.chunks_exact(2 * n).flat_map(move |row| &row[from..from + n]).copied();
            let driven: Vec<f64> = part(n).collect();
            for (driven, even) in driven.chunks_exact(n * n).zip(even.chunks_exact_mut(n * n)) {
                add_gram(driven, n, even);
            }
            Ok(Transition { mean, seen: part(0).collect(), noise: Some(even) })
        })
    }
}
