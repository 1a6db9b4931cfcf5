//! Prediction and update of a batch in square-root form: covariances are sums of squares, which cancellation
//! cannot make indefinite (G. J. Bierman, "Factorization Methods for Discrete Sequential Estimation", 1977).
//! The update is one orthogonal transformation of the roots (T. Kailath, A. H. Sayed and B. Hassibi, "Linear
//! Estimation", 2000, chapter 12), so that neither `S` nor a difference of covariances is ever factorised.

use super::checks::{check_measurement, expect, shared};
use super::failures::Failures;
use super::manifold::{Manifold, Vectors};
use super::state::GaussianState;
use crate::error::{Error, Result};
use crate::math::dense::{
    PIVOT_ROUNDING, add_gram, backward, covariance_root, forward, lower_triangle, multiply, symmetrise,
};

/// What is measured, linear in the state: `z - predicted = H (x - mean) + v`, with `P = L L^T`.
pub(super) struct Measured<'a> {
    /// `L`, `(B, n, n)`.
    pub roots: &'a [f64],
    /// `H L`, `(B, m, n)`.
    pub seen: &'a [f64],
    /// Covariance of `v`, `(m, m)` or `(B, m, m)`.
    pub noise: &'a [f64],
    /// `(B, m)`.
    pub predicted: &'a [f64],
}

/// Buffers for one state.
#[derive(Default)]
struct Scratch {
    seen: Vec<f64>,
    noise: Vec<f64>,
    noise_root: Vec<f64>,
    S: Vec<f64>,
    /// Roots of noise and state, and after the transformation those of `S` and of the new `P`.
    array: Vec<f64>,
    factor: Vec<f64>,
    gain: Vec<f64>,
    rest: Vec<f64>,
    white: Vec<f64>,
}

impl Scratch {
    /// For `m` measured components.
    fn resize(&mut self, n: usize, m: usize) {
        for (buffer, length) in [
            (&mut self.seen, m * n),
            (&mut self.noise, m * m),
            (&mut self.noise_root, m * m),
            (&mut self.S, m * m),
            (&mut self.array, (m + n) * (m + n)),
            (&mut self.factor, m * m),
            (&mut self.gain, m),
            (&mut self.rest, n * n),
            (&mut self.white, m),
        ] {
            buffer.resize(length, 0.0);
        }
    }
}

impl GaussianState {
    /// Takes in the measurements `z` `(B, m)`: of each state the components that are not NaN.
    pub(super) fn take_in(
        &mut self,
        z: &[f64],
        measured: &Measured<'_>,
        manifold: &mut impl Manifold,
        mut failures: Failures,
    ) -> Result<()> {
        let (n, m) = (self.dim_x, self.dim_z);
        expect("z", z, &[self.batch * m])?;
        check_measurement(z)?;
        // A missing component is replaced by its prediction, so that no function meets a NaN.
        let known: Vec<f64> = z.iter().zip(measured.predicted).map(|(z, p)| if z.is_nan() { *p } else { *z }).collect();
        let mut y = vec![0.0; z.len()];
        manifold.residual_z(&known, measured.predicted, &mut y)?;
        let mut plain = vec![0.0; y.len()];
        Vectors.residual_z(&known, measured.predicted, &mut plain)?;
        failures.add_out_of_range("residual_z", &mut y, &plain)?;
        let (mut P, mut dx) = (vec![0.0; self.P.len()], vec![0.0; self.x.len()]);
        let mut scratch = Scratch::default();
        let is_measured = |item: usize| z[item * m..(item + 1) * m].iter().any(|z| !z.is_nan());
        let mut components = Vec::with_capacity(m);
        for item in 0..self.batch {
            self.skip(item);
            components.clear();
            components.extend((0..m).filter(|&k| !z[item * m + k].is_nan()));
            if components.is_empty() || failures.has(item) {
                continue;
            }
            let (dx, P) = (&mut dx[item * n..(item + 1) * n], &mut P[item * n * n..(item + 1) * n * n]);
            let y = &y[item * m..(item + 1) * m];
            if !self.take_in_one(item, y, &components, measured, &mut scratch, (dx, P)) {
                failures.add(item, Error::Numerical(format!("S of state {item} is not positive definite; is R?")));
            }
        }
        failures.check()?;
        let mut x = vec![0.0; self.x.len()];
        manifold.state_add(&self.x, &dx, &mut x)?;
        let mut plain = vec![0.0; x.len()];
        Vectors.state_add(&self.x, &dx, &mut plain)?;
        failures.add_out_of_range("state_add", &mut x, &plain)?;
        self.finish(&x, &mut P, failures, is_measured)
    }

    /// The step and the new covariance of one state, by the components listed. False where `S` is singular.
    ///
    /// With `P = L L^T`: the rows `(R^1/2, H L)` and `(0, L)` become `(S^1/2, 0)` and `(K S^1/2, P'^1/2)`.
    fn take_in_one(
        &mut self,
        item: usize,
        y: &[f64],
        components: &[usize],
        measured: &Measured<'_>,
        scratch: &mut Scratch,
        (dx, P): (&mut [f64], &mut [f64]),
    ) -> bool {
        let (n, m, k) = (self.dim_x, self.dim_z, components.len());
        scratch.resize(n, k);
        let Scratch { seen, noise, noise_root, S, array, factor, gain, rest, white } = scratch;
        let root = &measured.roots[item * n * n..(item + 1) * n * n];
        let all_seen = &measured.seen[item * m * n..(item + 1) * m * n];
        let all_noise = shared(measured.noise, item, m * m);
        for (a, &i) in components.iter().enumerate() {
            seen[a * n..(a + 1) * n].copy_from_slice(&all_seen[i * n..(i + 1) * n]);
            for (b, &j) in components.iter().enumerate() {
                noise[a * k + b] = all_noise[i * m + j];
            }
            white[a] = y[i];
        }
        S.copy_from_slice(noise);
        add_gram(seen, n, S);
        symmetrise(S, k);
        let side = k + n;
        match covariance_root(noise, k, noise_root) {
            Some(repaired) => self.repairs += u64::from(repaired),
            None => return false,
        }
        array.fill(0.0);
        let (measured, state) = array.split_at_mut(k * side);
        for (a, row) in measured.chunks_exact_mut(side).enumerate() {
            row[..k].copy_from_slice(&noise_root[a * k..(a + 1) * k]);
            row[k..].copy_from_slice(&seen[a * n..(a + 1) * n]);
        }
        state.chunks_exact_mut(side).zip(root.chunks_exact(n)).for_each(|(row, root)| row[k..].copy_from_slice(root));
        lower_triangle(array, side);
        let (measured, state) = array.split_at(k * side);
        for (a, row) in measured.chunks_exact(side).enumerate() {
            let rounding = PIVOT_ROUNDING * side as f64 * S[a * k + a].sqrt();
            if row[a].is_nan() || row[a] <= rounding {
                return false;
            }
            factor[a * k..(a + 1) * k].copy_from_slice(&row[..k]);
        }
        forward(factor, k, white);
        let (all_y, all_S) = (&mut self.y[item * m..(item + 1) * m], &mut self.S[item * m * m..(item + 1) * m * m]);
        for (a, &i) in components.iter().enumerate() {
            all_y[i] = y[i];
            components.iter().enumerate().for_each(|(b, &j)| all_S[i * m + j] = S[a * k + b]);
        }
        for (r, row) in state.chunks_exact(side).enumerate() {
            gain.copy_from_slice(&row[..k]);
            dx[r] = gain.iter().zip(&*white).map(|(gain, y)| gain * y).sum();
            backward(factor, k, gain);
            components.iter().zip(&*gain).for_each(|(&i, gain)| self.K[item * n * m + r * m + i] = *gain);
            rest[r * n..(r + 1) * n].copy_from_slice(&row[k..]);
        }
        P.fill(0.0);
        add_gram(rest, n, P);
        let squared: f64 = white.iter().map(|v| v * v).sum();
        let determinant: f64 = (0..k).map(|i| factor[i * k + i].ln()).sum::<f64>() * 2.0;
        self.log_likelihood[item] = -0.5 * (squared + determinant + k as f64 * std::f64::consts::TAU.ln());
        self.mahalanobis[item] = if squared.is_normal() { squared.sqrt() } else { norm(white) };
        true
    }

    /// Sets every mean to `x` and every `P` to `(F L)(F L)^T + Q`, given `F` of each state `(B, n, n)` or of
    /// all `(n, n)`.
    pub(super) fn propagate(&mut self, x: &[f64], F: &[f64], failures: Failures) -> Result<()> {
        let n = self.dim_x;
        let roots = self.roots()?;
        let (mut P, mut moved) = (vec![0.0; self.P.len()], vec![0.0; n * n]);
        for (item, (P, root)) in P.chunks_exact_mut(n * n).zip(roots.chunks_exact(n * n)).enumerate() {
            multiply(shared(F, item, n * n), root, n, &mut moved);
            P.copy_from_slice(shared(&self.Q, item, n * n));
            symmetrise(P, n);
            add_gram(&moved, n, P);
        }
        self.finish(x, &mut P, failures, |_| true)
    }
}

/// Euclidean norm of numbers whose squares may leave the range of f64.
fn norm(values: &[f64]) -> f64 {
    let largest = values.iter().fold(0.0_f64, |largest, v| largest.max(v.abs()));
    if largest == 0.0 || largest.is_infinite() {
        return values.iter().map(|v| v.abs()).sum();
    }
    largest * values.iter().map(|v| (v / largest).powi(2)).sum::<f64>().sqrt()
}
