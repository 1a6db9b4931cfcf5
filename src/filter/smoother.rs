//! The Rauch-Tung-Striebel smoother of all Gaussian filters, in square-root form.

use super::checks::{check_covariances, check_finite, expect, shared};
use super::manifold::Manifold;
use super::state::{GaussianState, roots};
use crate::error::{Error, Result};
use crate::math::dense::{add_gram, covariance_root, multiply, multiply_transposed, solve, symmetrise};
use crate::parallel::checkpoint;

/// Smoothed means and covariances of `T` times; NaN where a state could not be smoothed.
#[derive(Debug, Clone, PartialEq)]
pub struct Smoothed {
    /// Means `(T, B, n)`.
    pub x: Vec<f64>,
    /// Covariances `(T, B, n, n)`.
    pub P: Vec<f64>,
    /// Gains from the next time `(T, B, n, n)`; zero at the last.
    pub K: Vec<f64>,
    /// Covariances predicted for the next time `(T, B, n, n)`; at the last time the filter's.
    pub Pp: Vec<f64>,
}

/// The step from one time to the next, linear in the state: `x' = mean + F (x - x_k) + w`, `P_k = L L^T`.
pub(super) struct Transition {
    /// `(B, n)`.
    pub mean: Vec<f64>,
    /// `F L`, `(B, n, n)`.
    pub seen: Vec<f64>,
    /// Covariance of `w`, `(B, n, n)`; `None`: `Q`.
    pub noise: Option<Vec<f64>>,
}

/// Smooths backwards. `step` gets the number of the next time, `Q` of the step to it, and the means and
/// roots of one time.
///
/// With `P' = F P F^T + Q` and the gain `C = P F^T P'^-1`: `x + C (x_s' - mean)` and `(L - C F L)(L - C F
/// L)^T + C (Q + P_s') C^T`, which equals the usual `P + C (P_s' - P') C^T` and cannot become indefinite.
pub(super) fn smooth<M: Manifold>(
    state: &GaussianState,
    manifold: &mut M,
    (Xs, Ps): (&[f64], &[f64]),
    Qs: Option<&[Vec<f64>]>,
    mut step: impl FnMut(&mut M, (usize, &[f64]), &[f64], &[f64]) -> Result<Transition>,
) -> Result<Smoothed> {
    let (n, means) = (state.dim_x, state.batch * state.dim_x);
    if !Xs.len().is_multiple_of(means) {
        let expected = format!("a multiple of {means} values");
        return Err(Error::argument("Xs", expected, format!("{} values", Xs.len())));
    }
    let (times, size) = (Xs.len() / means, means * n);
    expect("Ps", Ps, &[times * size])?;
    check_finite("Xs", Xs)?;
    check_covariances("Ps", Ps, n)?;
    for (_, Q) in (1..times).zip(Qs.unwrap_or_default().iter().skip(1)) {
        expect("Qs", Q, &[n * n, size])?;
        check_covariances("Qs", Q, n)?;
    }
    let mut out = Smoothed { x: Xs.to_vec(), P: Ps.to_vec(), K: vec![0.0; Ps.len()], Pp: Ps.to_vec() };
    let square = n * n;
    let (mut noise, mut rest, mut weighted) = (vec![0.0; square], vec![0.0; square], vec![0.0; square]);
    let mut factor = vec![0.0; square];
    for k in (0..times.saturating_sub(1)).rev() {
        checkpoint();
        let x = &Xs[k * means..(k + 1) * means];
        let mut P = Ps[k * size..(k + 1) * size].to_vec();
        let (roots, _) = roots(&mut P, n)?;
        let Q = Qs.map_or(&state.Q, |Qs| &Qs[k + 1]);
        let moved = step(manifold, (k + 1, Q), x, &roots)?;
        let mut residual = vec![0.0; means];
        let (before, after) = out.x.split_at_mut((k + 1) * means);
        manifold.residual_x(&after[..means], &moved.mean, &mut residual)?;
        let mut dx = vec![0.0; means];
        for item in 0..state.batch {
            let all = |time: usize| time * size + item * square..time * size + (item + 1) * square;
            let (root, seen) = (&roots[item * square..][..square], &moved.seen[item * square..][..square]);
            noise.copy_from_slice(shared(moved.noise.as_ref().unwrap_or(Q), item, square));
            let Pp = &mut out.Pp[all(k)];
            Pp.copy_from_slice(&noise);
            symmetrise(Pp, n);
            add_gram(seen, n, Pp);
            let K = &mut out.K[all(k)];
            multiply_transposed(root, seen, n, K);
            if covariance_root(&mut Pp.to_vec(), n, &mut factor).is_none() {
                K.fill(f64::NAN);
            }
            K.chunks_exact_mut(n).for_each(|row| solve(&factor, n, row));
            for (dx, K) in dx[item * n..(item + 1) * n].iter_mut().zip(K.chunks_exact(n)) {
                *dx = K.iter().zip(&residual[item * n..]).map(|(k, y)| k * y).sum();
            }
            noise.iter_mut().zip(&out.P[all(k + 1)]).for_each(|(q, next)| *q += next);
            multiply(K, seen, n, &mut rest);
            rest.iter_mut().zip(root).for_each(|(rest, root)| *rest = root - *rest);
            multiply(K, &noise, n, &mut weighted);
            let P = &mut out.P[all(k)];
            multiply_transposed(&weighted, K, n, P);
            symmetrise(P, n);
            add_gram(&rest, n, P);
        }
        manifold.state_add(x, &dx, &mut before[k * means..])?;
    }
    Ok(out)
}
