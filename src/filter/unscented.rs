//! The unscented filter (S. Julier, J. Uhlmann, "Unscented filtering and nonlinear estimation", 2004).

use super::sigma_points::SigmaPoints;
use super::state::{GaussianState, check_measurement, expect, finite, reach_state, shared};
use crate::error::{Error, Result};
use crate::math::{dense::cholesky, dense::solve, dense::symmetrise};

/// A batch of unscented Kalman filters: `x' = f(x) + w` (or `f(x, w)`), `z = h(x) + v`.
///
/// A callback receives sigma points as rows, `(B (2 n + 1), n)`: those of one state follow each other, the
/// mean first, then `+`, then `-` in the order of the Cholesky factor's columns; it fills as many rows of `n`
/// or `m` values. Errors of a callback are passed on and leave `x` and `P` as they were. The fields of
/// [`GaussianState`] (`x`, `P`, `Q`, `R`, `y`, `S`, `K`, ...) are reached directly.
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
    /// [`Error::Argument`] when a dimension is zero or the constants do not fit `dim_x`.
    pub fn new(batch: usize, dim_x: usize, dim_z: usize, points: SigmaPoints) -> Result<Self> {
        let state = GaussianState::new(batch, dim_x, dim_z)?;
        points.check(dim_x)?;
        Ok(Self { state, points, redraw: true, sigmas: Vec::new() })
    }

    /// Additive noise: the `2 n + 1` points go through `fx`, and `Q` is added to their covariance.
    ///
    /// # Errors
    /// Those of `fx`; [`Error::Argument`] for arrays of wrong length or results that are not finite;
    /// [`Error::Numerical`] when `P` cannot be mended.
    pub fn predict(&mut self, mut fx: impl FnMut(&[f64], &mut [f64]) -> Result<()>) -> Result<()> {
        self.check()?;
        self.points.check(self.dim_x)?;
        let drawn = self.draw()?;
        let mut sigmas = vec![0.0; drawn.len()];
        fx(&drawn, &mut sigmas)?;
        finite("fx", &sigmas)?;
        let (n, q) = (self.dim_x, self.Q.clone());
        self.take_moments(sigmas, n, Some(&q))
    }

    /// Augmented noise: `4 n + 1` points of the state with its noise `w ~ N(0, Q)`; `fx` receives the state
    /// rows and the noise rows, `(B (4 n + 1), n)` each. `Q` may be zero in some directions.
    ///
    /// # Errors
    /// As [`predict`](Self::predict); [`Error::Numerical`] when `Q` is not positive semidefinite.
    pub fn predict_augmented(&mut self, mut fx: impl FnMut(&[f64], &[f64], &mut [f64]) -> Result<()>) -> Result<()> {
        self.check()?;
        let (n, batch) = (self.dim_x, self.batch);
        self.points.check(2 * n)?;
        let l = self.state.factors()?;
        let (rows, scale) = (SigmaPoints::count(2 * n), self.points.spread(2 * n).sqrt());
        let mut states = vec![0.0; batch * rows * n];
        let mut noises = vec![0.0; batch * rows * n];
        for item in 0..batch {
            let root = semidefinite_root(shared(&self.Q, item, n * n), n)?;
            let x = &self.x[item * n..(item + 1) * n];
            let states = &mut states[item * rows * n..(item + 1) * rows * n];
            let noises = &mut noises[item * rows * n..(item + 1) * rows * n];
            states.chunks_exact_mut(n).for_each(|row| row.copy_from_slice(x));
            for k in 0..n {
                for i in 0..n {
                    let step = scale * l[item * n * n + i * n + k];
                    states[(1 + k) * n + i] += step;
                    states[(1 + 2 * n + k) * n + i] -= step;
                    noises[(1 + n + k) * n + i] = scale * root[i * n + k];
                    noises[(1 + 3 * n + k) * n + i] = -scale * root[i * n + k];
                }
            }
        }
        let mut sigmas = vec![0.0; states.len()];
        fx(&states, &noises, &mut sigmas)?;
        finite("fx", &sigmas)?;
        self.take_moments(sigmas, 2 * n, None)
    }

    /// Takes in the measurements `z` `(B, m)` through `hx`; NaN means no measurement.
    ///
    /// # Errors
    /// Those of `hx`; [`Error::Argument`] for arrays of wrong length or results that are not finite;
    /// [`Error::Numerical`] when `P` cannot be mended or the innovation covariance is not positive definite.
    pub fn update(&mut self, z: &[f64], mut hx: impl FnMut(&[f64], &mut [f64]) -> Result<()>) -> Result<()> {
        self.check()?;
        self.points.check(self.dim_x)?;
        let (n, m, batch) = (self.dim_x, self.dim_z, self.batch);
        expect("z", z, &[batch * m])?;
        check_measurement(z)?;
        let factors = self.state.factors()?;
        let sigmas = if self.redraw || self.sigmas.is_empty() { self.draw_from(&factors) } else { self.sigmas.clone() };
        let rows = sigmas.len() / (batch * n);
        let mut measured = vec![0.0; batch * rows * m];
        hx(&sigmas, &mut measured)?;
        finite("hx", &measured)?;
        let dims = (rows - 1) / 2;
        let (wm, wc) = (self.points.mean_weights(dims), self.points.covariance_weights(dims));
        for (item, z) in z.chunks_exact(m).enumerate() {
            if z.iter().any(|v| v.is_nan()) {
                self.state.skip(item);
                continue;
            }
            let measured = &measured[item * rows * m..(item + 1) * rows * m];
            let points = &sigmas[item * rows * n..(item + 1) * rows * n];
            let mean = weighted_mean(measured, &wm, m);
            let x = &self.x[item * n..(item + 1) * n];
            let cross = weighted_product(measured, &mean, points, x, &wc);
            let mut spread = weighted_product(measured, &mean, measured, &mean, &wc);
            // The measurement seen as linear: H = P_zx P^-1; what H does not explain is noise.
            let mut h = cross.clone();
            h.chunks_exact_mut(n).for_each(|row| solve(&factors[item * n * n..(item + 1) * n * n], n, row));
            for a in 0..m {
                for b in 0..m {
                    let explained: f64 = (0..n).map(|k| h[a * n + k] * cross[b * n + k]).sum();
                    spread[a * m + b] -= explained;
                }
            }
            symmetrise(&mut spread, m);
            let y: Vec<f64> = z.iter().zip(&mean).map(|(z, p)| z - p).collect();
            let r: Vec<f64> =
                shared(&self.R, item, m * m).iter().zip(&spread).map(|(r, unexplained)| r + unexplained).collect();
            self.state.joseph_update(item, &y, &h, &r)?;
        }
        Ok(())
    }

    /// The sigma points `(B, 2 n + 1, n)` of the present `x` and `P`.
    ///
    /// # Errors
    /// [`Error::Numerical`] when a covariance cannot be mended.
    pub fn draw(&mut self) -> Result<Vec<f64>> {
        let l = self.state.factors()?;
        Ok(self.draw_from(&l))
    }

    fn draw_from(&self, factors: &[f64]) -> Vec<f64> {
        let n = self.dim_x;
        let rows = SigmaPoints::count(n);
        let mut out = vec![0.0; self.batch * rows * n];
        for (item, out) in out.chunks_exact_mut(rows * n).enumerate() {
            self.points.draw(&self.x[item * n..(item + 1) * n], &factors[item * n * n..(item + 1) * n * n], out);
        }
        out
    }

    /// Sets `x` and `P` to the weighted moments of propagated points (`dims`), plus additive noise.
    fn take_moments(&mut self, sigmas: Vec<f64>, dims: usize, noise: Option<&[f64]>) -> Result<()> {
        let n = self.dim_x;
        let rows = SigmaPoints::count(dims);
        let (wm, wc) = (self.points.mean_weights(dims), self.points.covariance_weights(dims));
        for (item, points) in sigmas.chunks_exact(rows * n).enumerate() {
            let mean = weighted_mean(points, &wm, n);
            let mut p = weighted_product(points, &mean, points, &mean, &wc);
            if let Some(q) = noise {
                p.iter_mut().zip(shared(q, item, n * n)).for_each(|(p, q)| *p += q);
            }
            symmetrise(&mut p, n);
            self.x[item * n..(item + 1) * n].copy_from_slice(&mean);
            self.P[item * n * n..(item + 1) * n * n].copy_from_slice(&p);
        }
        self.sigmas = sigmas;
        self.state.keep_all_sound()
    }
}

/// `sum_k w_k rows_k`, taken relative to the centre so that large common offsets do not cost digits.
fn weighted_mean(rows: &[f64], weights: &[f64], width: usize) -> Vec<f64> {
    let centre = &rows[..width];
    let mut mean = centre.to_vec();
    for (row, &w) in rows.chunks_exact(width).zip(weights).skip(1) {
        mean.iter_mut().zip(row).zip(centre).for_each(|((m, &r), &c)| *m += w * (r - c));
    }
    mean
}

/// `sum_k w_k (a_k - mean_a) (b_k - mean_b)^T`.
fn weighted_product(a: &[f64], mean_a: &[f64], b: &[f64], mean_b: &[f64], weights: &[f64]) -> Vec<f64> {
    let (wa, wb) = (mean_a.len(), mean_b.len());
    let mut out = vec![0.0; wa * wb];
    for ((a, b), &w) in a.chunks_exact(wa).zip(b.chunks_exact(wb)).zip(weights) {
        for (i, out) in out.chunks_exact_mut(wb).enumerate() {
            let da = w * (a[i] - mean_a[i]);
            out.iter_mut().zip(b).zip(mean_b).for_each(|((o, &b), &m)| *o += da * (b - m));
        }
    }
    out
}

/// The lower square root of a positive semidefinite matrix; rows and columns that are zero stay zero.
fn semidefinite_root(q: &[f64], n: usize) -> Result<Vec<f64>> {
    let used: Vec<usize> = (0..n).filter(|&k| q[k * n + k] != 0.0).collect();
    let m = used.len();
    let small: Vec<f64> = used.iter().flat_map(|&i| used.iter().map(move |&j| q[i * n + j])).collect();
    let mut l = vec![0.0; m * m];
    if !cholesky(&small, m, &mut l) {
        return Err(Error::Numerical("Q is not positive semidefinite".into()));
    }
    let mut out = vec![0.0; n * n];
    for (a, &i) in used.iter().enumerate() {
        for (b, &j) in used.iter().enumerate() {
            out[i * n + j] = l[a * m + b];
        }
    }
    Ok(out)
}

reach_state!(UnscentedFilter);
