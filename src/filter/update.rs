//! Prediction and update of a batch in square-root form: covariances are sums of squares, which cancellation
//! cannot make indefinite (G. J. Bierman, "Factorization Methods for Discrete Sequential Estimation", 1977).

use super::checks::{check_measurement, expect, shared};
use super::failures::Failures;
use super::manifold::Manifold;
use super::state::GaussianState;
use crate::error::{Error, Result};
use crate::math::dense::{add_gram, cholesky, forward, multiply, multiply_transposed, solve, symmetrise};

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
struct Scratch {
    seen: Vec<f64>,
    noise: Vec<f64>,
    S: Vec<f64>,
    factor: Vec<f64>,
    K: Vec<f64>,
    weighted: Vec<f64>,
    rest: Vec<f64>,
    white: Vec<f64>,
}

impl Scratch {
    /// For `m` measured components.
    fn resize(&mut self, n: usize, m: usize) {
        for (buffer, length) in [
            (&mut self.seen, m * n),
            (&mut self.noise, m * m),
            (&mut self.S, m * m),
            (&mut self.factor, m * m),
            (&mut self.K, n * m),
            (&mut self.weighted, n * m),
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
        failures.add_infinite("residual_z", &mut y)?;
        let (mut P, mut dx) = (vec![0.0; self.P.len()], vec![0.0; self.x.len()]);
        let none = Vec::new;
        let (seen, noise, S, factor) = (none(), none(), none(), none());
        let (K, weighted, rest, white) = (none(), none(), none(), none());
        let mut scratch = Scratch { seen, noise, S, factor, K, weighted, rest, white };
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
        failures.add_infinite("state_add", &mut x)?;
        self.finish(&x, &mut P, failures, is_measured)
    }

    /// The step and the new covariance of one state, by the components listed. False where `S` is singular.
    ///
    /// With the gain `K`: `P = (L - K H L)(L - K H L)^T + K R K^T`, Joseph's form.
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
        let Scratch { seen, noise, S, factor, K, weighted, rest, white } = scratch;
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
        if !cholesky(S, k, factor) {
            return false;
        }
        multiply_transposed(root, seen, n, K);
        K.chunks_exact_mut(k).for_each(|row| solve(factor, k, row));
        for (dx, K) in dx.iter_mut().zip(K.chunks_exact(k)) {
            *dx = K.iter().zip(&*white).map(|(k, y)| k * y).sum();
        }
        multiply(K, seen, k, rest);
        rest.iter_mut().zip(root).for_each(|(rest, root)| *rest = root - *rest);
        multiply(K, noise, k, weighted);
        multiply_transposed(weighted, K, k, P);
        symmetrise(P, n);
        add_gram(rest, n, P);
        let y = &mut self.y[item * m..(item + 1) * m];
        for (a, &i) in components.iter().enumerate() {
            y[i] = white[a];
            for (b, &j) in components.iter().enumerate() {
                self.S[item * m * m + i * m + j] = S[a * k + b];
            }
            for row in 0..n {
                self.K[item * n * m + row * m + i] = K[row * k + a];
            }
        }
        forward(factor, k, white);
        let squared: f64 = white.iter().map(|v| v * v).sum();
        let determinant: f64 = (0..k).map(|i| factor[i * k + i].ln()).sum::<f64>() * 2.0;
        self.log_likelihood[item] = -0.5 * (squared + determinant + k as f64 * std::f64::consts::TAU.ln());
        self.mahalanobis[item] = squared.sqrt();
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
