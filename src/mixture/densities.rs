//! The densities that the E step evaluates.

use super::{points::BAND, points::Points};
use crate::error::{Error, Result};
use crate::math::dense;
use crate::parallel;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};

/// Lower Cholesky factors of one matrix a component, and the logarithms of their determinants.
#[derive(Debug)]
pub(super) struct Factors {
    pub lower: Vec<f64>,
    pub log_determinants: Vec<f64>,
}

impl Factors {
    /// Those of symmetric matrices (K, D, D).
    ///
    /// # Errors
    /// [`Error::Numerical`] for a matrix that cannot be mended.
    pub fn of_matrices(matrices: &[f64], d: usize) -> Result<Self> {
        let mut lower = vec![0.0; matrices.len()];
        for (k, (matrix, l)) in matrices.chunks_exact(d * d).zip(lower.chunks_exact_mut(d * d)).enumerate() {
            if !dense::cholesky(matrix, d, l) && dense::factor(&mut matrix.to_vec(), d, l).is_none() {
                return Err(Error::Numerical(format!("the covariance of component {k} is not positive definite")));
            }
        }
        let log_determinants =
            lower.chunks_exact(d * d).map(|l| 2.0 * (0..d).map(|i| l[i * (d + 1)].ln()).sum::<f64>()).collect();
        Ok(Self { lower, log_determinants })
    }
}

/// `ln rho_nk = constant_k - |A_k (x_n - m_k)|^2` (14) with `A_k^T A_k = nu_k W_k / 2`, lower triangular.
#[derive(Debug)]
pub(super) struct Densities {
    pub dimensions: usize,
    /// (K).
    pub constants: Vec<f64>,
    /// (K, D).
    pub means: Vec<f64>,
    /// Rows of the lower triangles, one after another: (K, D (D + 1) / 2).
    pub whitening: Vec<f64>,
}

impl Densities {
    /// Those of `factor_k N(x; mean_k, covariance_k)`, from log factors, means and Cholesky factors.
    pub fn gaussian(log_factors: &[f64], means: &[f64], factors: &Factors) -> Self {
        let (components, d) = (log_factors.len(), means.len() / log_factors.len());
        let mut whitening = Vec::with_capacity(components * d * (d + 1) / 2);
        for lower in factors.lower.chunks_exact(d * d) {
            let inverse = inverse_of_lower(lower, d);
            for i in 0..d {
                whitening.extend(inverse[i * d..=i * d + i].iter().map(|value| FRAC_1_SQRT_2 * value));
            }
        }
        let constant = |(log, determinant): (&f64, &f64)| log - 0.5 * (determinant + d as f64 * TAU.ln());
        let constants = log_factors.iter().zip(&factors.log_determinants).map(constant).collect();
        Self { dimensions: d, constants, means: means.to_vec(), whitening }
    }

    /// K.
    pub fn components(&self) -> usize {
        self.constants.len()
    }

    /// Values of a lower triangle.
    pub fn triangle(&self) -> usize {
        self.dimensions * (self.dimensions + 1) / 2
    }

    /// `ln rho` of one point under one component.
    fn log_density(&self, k: usize, x: &[f64]) -> f64 {
        let mean = &self.means[k * self.dimensions..];
        let mut rows = &self.whitening[k * self.triangle()..];
        let mut square = 0.0;
        for i in 0..self.dimensions {
            let (row, rest) = rows.split_at(i + 1);
            let z: f64 = row.iter().zip(x.iter().zip(mean)).map(|(a, (x, m))| a * (x - m)).sum();
            square += z * z;
            rows = rest;
        }
        self.constants[k] - square
    }

    /// Shares of the components in one point (K); returns `ln sum_k rho_k`.
    pub fn share(&self, x: &[f64], shares: &mut [f64]) -> f64 {
        for (k, share) in shares.iter_mut().enumerate() {
            *share = self.log_density(k, x);
        }
        let most = shares.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mut sum = 0.0;
        for share in shares.iter_mut() {
            *share = (*share - most).exp();
            sum += *share;
        }
        for share in shares.iter_mut() {
            *share /= sum;
        }
        most + sum.ln()
    }

    /// `ln sum_k rho_nk` of checked points (N), and the share of each component in them (N, K), row-major.
    pub fn log_densities(&self, points: &Points) -> (Vec<f64>, Vec<f64>) {
        let components = self.components();
        let mut shares = vec![0.0; points.count() * components];
        let mut sums = vec![0.0; points.count()];
        let bands = shares.chunks_mut(BAND * components).zip(sums.chunks_mut(BAND)).enumerate();
        parallel::for_each(bands, |(band, (shares, sums))| {
            for (n, (row, sum)) in shares.chunks_exact_mut(components).zip(sums).enumerate() {
                *sum = self.share(points.at(band * BAND + n), row);
            }
        });
        (sums, shares)
    }
}

/// `l^-1` of a lower triangular matrix, row-major.
pub(super) fn inverse_of_lower(l: &[f64], d: usize) -> Vec<f64> {
    let mut inverse = vec![0.0; d * d];
    let mut column = vec![0.0; d];
    for j in 0..d {
        column.fill(0.0);
        column[j] = 1.0;
        dense::forward(l, d, &mut column);
        for i in 0..d {
            inverse[i * d + j] = column[i];
        }
    }
    inverse
}
