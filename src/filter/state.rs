//! What every filter here holds: a batch of Gaussians, the noise, and the last update's by-products.

use crate::error::{Error, Result};
use crate::math::dense::{
    cholesky, covariance_fault, factor, forward, mend, multiply, multiply_transposed, solve, symmetrise,
};

/// A batch of `B` independent Gaussian states, `n` dimensions, `m` measured numbers; row-major arrays.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GaussianState {
    /// `B`, the number of states.
    pub batch: usize,
    /// `n`, dimensions of the state.
    pub dim_x: usize,
    /// `m`, dimensions of the measurement.
    pub dim_z: usize,
    /// Means `(B, n)`; zero at first.
    pub x: Vec<f64>,
    /// Covariances `(B, n, n)`; identity at first.
    pub P: Vec<f64>,
    /// Process noise, `(n, n)` for every state or `(B, n, n)`; identity at first.
    pub Q: Vec<f64>,
    /// Measurement noise, `(m, m)` for every state or `(B, m, m)`; identity at first.
    pub R: Vec<f64>,
    /// Residual (innovation) of the last update, `(B, m)`; zero where the measurement was missing.
    pub y: Vec<f64>,
    /// Covariance of the residual, `(B, m, m)`; zero where the measurement was missing.
    pub S: Vec<f64>,
    /// Gain, `(B, n, m)`; zero where the measurement was missing.
    pub K: Vec<f64>,
    /// `log N(y; 0, S)` of the last update, `(B)`; zero where the measurement was missing.
    pub log_likelihood: Vec<f64>,
    /// How often a covariance had lost its positive definiteness and was mended.
    pub repairs: u64,
}

impl GaussianState {
    /// `batch` states of `dim_x` dimensions with zero mean and identity covariances.
    ///
    /// # Errors
    /// [`Error::Argument`] when a dimension is zero or above 4096, or when the memory that `batch` states
    /// take in a step cannot be had.
    pub fn new(batch: usize, dim_x: usize, dim_z: usize) -> Result<Self> {
        check_dimension("dim_x", dim_x)?;
        check_dimension("dim_z", dim_z)?;
        check_batch(batch, dim_x, dim_z)?;
        let identity = |n: usize| (0..n * n).map(|k| f64::from(u8::from(k % (n + 1) == 0))).collect::<Vec<_>>();
        Ok(Self {
            batch,
            dim_x,
            dim_z,
            x: vec![0.0; batch * dim_x],
            P: identity(dim_x).repeat(batch),
            Q: identity(dim_x),
            R: identity(dim_z),
            y: vec![0.0; batch * dim_z],
            S: vec![0.0; batch * dim_z * dim_z],
            K: vec![0.0; batch * dim_x * dim_z],
            log_likelihood: vec![0.0; batch],
            repairs: 0,
        })
    }

    /// Checks sizes and values of the public arrays, which a caller may have replaced.
    pub(super) fn check(&self) -> Result<()> {
        let (b, n, m) = (self.batch, self.dim_x, self.dim_z);
        expect("x", &self.x, &[b * n])?;
        expect("P", &self.P, &[b * n * n])?;
        expect("Q", &self.Q, &[n * n, b * n * n])?;
        expect("R", &self.R, &[m * m, b * m * m])?;
        check_mean(&self.x)?;
        check_covariances("P", &self.P, n)?;
        check_covariances("Q", &self.Q, n)?;
        check_covariances("R", &self.R, m)
    }

    /// Mends the covariance of one state after a step if needed, and counts that; refuses infinite numbers.
    fn keep_sound(&mut self, item: usize) -> Result<()> {
        let n = self.dim_x;
        let (x, p) = (&self.x[item * n..(item + 1) * n], &mut self.P[item * n * n..(item + 1) * n * n]);
        if x.iter().chain(&*p).any(|v| !v.is_finite()) {
            return Err(Error::Numerical(format!("x or P of state {item} has outgrown the range of numbers")));
        }
        let mended =
            mend(p, n).ok_or_else(|| Error::Numerical(format!("P of state {item} has no positive-definite repair")))?;
        self.repairs += u64::from(mended);
        Ok(())
    }

    /// [`Self::keep_sound`] for every state.
    pub(super) fn keep_all_sound(&mut self) -> Result<()> {
        (0..self.batch).try_for_each(|item| self.keep_sound(item))
    }

    /// The Cholesky factors `(B, n, n)` of every covariance; mends those that need it.
    pub(super) fn factors(&mut self) -> Result<Vec<f64>> {
        let n = self.dim_x;
        let mut all = vec![0.0; self.P.len()];
        for (item, (p, l)) in self.P.chunks_exact_mut(n * n).zip(all.chunks_exact_mut(n * n)).enumerate() {
            match factor(p, n, l) {
                Some(mended) => self.repairs += u64::from(mended),
                None => return Err(Error::Numerical(format!("P of state {item} has no positive-definite repair"))),
            }
        }
        Ok(all)
    }

    /// The update of one state by the residual `y` through the (statistically linearised) measurement matrix
    /// `h` `(m, n)` with noise `r` `(m, m)`, in Joseph's form `P = (I - K H) P (I - K H)^T + K R K^T`, which
    /// cannot lose positive definiteness to cancellation.
    pub(super) fn joseph_update(&mut self, item: usize, y: &[f64], h: &[f64], r: &[f64]) -> Result<()> {
        let (n, m) = (self.dim_x, self.dim_z);
        let p = &mut self.P[item * n * n..(item + 1) * n * n];
        let k = &mut self.K[item * n * m..(item + 1) * n * m];
        let s = &mut self.S[item * m * m..(item + 1) * m * m];
        // S = H P H^T + R; K = P H^T S^-1, row by row because S is symmetric.
        multiply_transposed(p, h, n, k);
        multiply(h, k, n, s);
        s.iter_mut().zip(r).for_each(|(s, r)| *s += r);
        symmetrise(s, m);
        let mut l = vec![0.0; m * m];
        if !cholesky(s, m, &mut l) {
            return Err(Error::Numerical(format!("S of state {item} is not positive definite; is R?")));
        }
        k.chunks_exact_mut(m).for_each(|row| solve(&l, m, row));
        let x = &mut self.x[item * n..(item + 1) * n];
        for (x, k) in x.iter_mut().zip(k.chunks_exact(m)) {
            *x += k.iter().zip(y).map(|(k, y)| k * y).sum::<f64>();
        }
        let (mut keep, mut half, mut noise) = (vec![0.0; n * n], vec![0.0; n * n], vec![0.0; n * m]);
        multiply(k, h, m, &mut keep);
        for (index, value) in keep.iter_mut().enumerate() {
            *value = f64::from(u8::from(index % (n + 1) == 0)) - *value;
        }
        multiply(&keep, p, n, &mut half);
        multiply_transposed(&half, &keep, n, p);
        multiply(k, r, m, &mut noise);
        multiply_transposed(&noise, k, m, &mut half);
        p.iter_mut().zip(&half).for_each(|(p, q)| *p += q);
        symmetrise(p, n);
        let mut white = y.to_vec();
        forward(&l, m, &mut white);
        let determinant: f64 = (0..m).map(|i| l[i * m + i].ln()).sum::<f64>() * 2.0;
        self.y[item * m..(item + 1) * m].copy_from_slice(y);
        self.log_likelihood[item] =
            -0.5 * (white.iter().map(|v| v * v).sum::<f64>() + determinant + m as f64 * std::f64::consts::TAU.ln());
        self.keep_sound(item)
    }

    /// Takes in the measurements `z` `(B, m)`, predicted as these and by `h`, `(m, n)` or `(B, m, n)`; skips
    /// states with a NaN among their numbers.
    pub(super) fn update_all(&mut self, z: &[f64], predicted: &[f64], h: &[f64]) -> Result<()> {
        let (n, m) = (self.dim_x, self.dim_z);
        for (item, (z, predicted)) in z.chunks_exact(m).zip(predicted.chunks_exact(m)).enumerate() {
            if z.iter().any(|v| v.is_nan()) {
                self.skip(item);
                continue;
            }
            let y: Vec<f64> = z.iter().zip(predicted).map(|(z, p)| z - p).collect();
            let r = shared(&self.R, item, m * m).to_vec();
            self.joseph_update(item, &y, shared(h, item, m * n), &r)?;
        }
        Ok(())
    }

    /// Clears the by-products of a state whose measurement is missing.
    pub(super) fn skip(&mut self, item: usize) {
        let (n, m) = (self.dim_x, self.dim_z);
        self.y[item * m..(item + 1) * m].fill(0.0);
        self.S[item * m * m..(item + 1) * m * m].fill(0.0);
        self.K[item * n * m..(item + 1) * n * m].fill(0.0);
        self.log_likelihood[item] = 0.0;
    }

    /// Sets every `P` to `F P F^T + Q`, given `F` of each state `(B, n, n)` or of all `(n, n)`.
    pub(super) fn propagate_covariance(&mut self, f: &[f64]) -> Result<()> {
        let n = self.dim_x;
        let mut half = vec![0.0; n * n];
        for item in 0..self.batch {
            let p = &mut self.P[item * n * n..(item + 1) * n * n];
            let f = shared(f, item, n * n);
            multiply(f, p, n, &mut half);
            multiply_transposed(&half, f, n, p);
            p.iter_mut().zip(shared(&self.Q, item, n * n)).for_each(|(p, q)| *p += q);
            symmetrise(p, n);
        }
        self.keep_all_sound()
    }
}

/// Largest dimension of a state or a measurement: one matrix of it takes 128 MiB.
pub(super) const LARGEST_DIMENSION: usize = 4096;

/// Refuses a dimension that no filter can have; `name` is the argument.
///
/// # Errors
/// [`Error::Argument`] when it is zero or above 4096.
pub fn check_dimension(name: &'static str, n: usize) -> Result<()> {
    if (1..=LARGEST_DIMENSION).contains(&n) {
        return Ok(());
    }
    Err(Error::argument(name, format!("an integer from 1 to {LARGEST_DIMENSION}"), n))
}

/// Refuses a number of states without the memory that an unscented step takes.
fn check_batch(batch: usize, n: usize, m: usize) -> Result<()> {
    if batch == 0 {
        return Err(Error::argument("batch", "a positive integer", 0));
    }
    let one = 16 * n * n + 8 * n * m + 4 * m * m;
    let room = batch.checked_mul(one).map(|values| Vec::<f64>::new().try_reserve_exact(values));
    if matches!(room, Some(Ok(()))) {
        return Ok(());
    }
    let expected = format!("as many filters of {n} state and {m} measurement dimensions as memory holds");
    Err(Error::argument("batch", expected, batch))
}

/// Refuses a mean that is not finite.
///
/// # Errors
/// [`Error::Argument`] naming `x`.
pub fn check_mean(x: &[f64]) -> Result<()> {
    refuse("x", x, |v| !v.is_finite(), "finite numbers")
}

/// Refuses `(n, n)` matrices that are not finite, symmetric and positive semi-definite to rounding.
///
/// # Errors
/// [`Error::Argument`] naming `name` and what is wrong.
pub fn check_covariances(name: &'static str, values: &[f64], n: usize) -> Result<()> {
    match values.chunks_exact(n * n).find_map(|matrix| covariance_fault(matrix, n)) {
        Some(fault) => Err(Error::argument(name, "a symmetric positive semi-definite matrix of finite numbers", fault)),
        None => Ok(()),
    }
}

/// Refuses a measurement that is infinite; NaN stands for a missing one.
pub(super) fn check_measurement(z: &[f64]) -> Result<()> {
    refuse("z", z, f64::is_infinite, "finite numbers, or NaN where one is missing")
}

/// Refuses a matrix with an entry that is not finite.
pub(super) fn check_matrix(name: &'static str, values: &[f64]) -> Result<()> {
    refuse(name, values, |v| !v.is_finite(), "a matrix of finite numbers")
}

/// The part of `values` that belongs to `item`: `values` has `size` values for all, or `size` for each.
pub(super) fn shared(values: &[f64], item: usize, size: usize) -> &[f64] {
    let start = if values.len() == size { 0 } else { item * size };
    &values[start..start + size]
}

/// Refuses an array that has none of the allowed lengths.
pub(super) fn expect(name: &'static str, values: &[f64], lengths: &[usize]) -> Result<()> {
    if lengths.contains(&values.len()) {
        return Ok(());
    }
    let mut allowed: Vec<_> = lengths.iter().map(ToString::to_string).collect();
    allowed.dedup();
    Err(Error::argument(name, format!("{} values", allowed.join(" or ")), format!("{} values", values.len())))
}

/// Refuses a callback's result that holds NaN or infinity, which would spread silently.
pub(super) fn finite(name: &'static str, values: &[f64]) -> Result<()> {
    refuse(name, values, |v| !v.is_finite(), "a function with finite results")
}

fn refuse(name: &'static str, values: &[f64], is_wrong: fn(f64) -> bool, expected: &'static str) -> Result<()> {
    match values.iter().find(|v| is_wrong(**v)) {
        Some(value) => Err(Error::argument(name, expected, value)),
        None => Ok(()),
    }
}

/// The fields of the state are reached from the filter directly.
macro_rules! reach_state {
    ($filter:ty) => {
        impl std::ops::Deref for $filter {
            type Target = GaussianState;
            fn deref(&self) -> &GaussianState {
                &self.state
            }
        }
        impl std::ops::DerefMut for $filter {
            fn deref_mut(&mut self) -> &mut GaussianState {
                &mut self.state
            }
        }
    };
}
pub(super) use reach_state;
