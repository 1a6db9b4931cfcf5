//! What is believed of the components after the M step.

use super::densities::{Densities, Factors, inverse_of_lower};
use super::moments::{Moments, keep_rows};
use super::points::Points;
use super::prior::Prior;
use crate::error::{Error, Result};
use crate::math::special::digamma;
use std::f64::consts::{LN_2, TAU};

/// `pi ~ Dir(alpha)` (22), `mu_k ~ N(m_k, (beta_k Lambda_k)^-1)`, `Lambda_k ~ W(W_k, nu_k)` (24).
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Posterior {
    /// D.
    pub dimensions: usize,
    /// `alpha_k` (K), equation (23).
    pub weight_concentration: Vec<f64>,
    /// `beta_k` (K), equation (25).
    pub mean_precision: Vec<f64>,
    /// `nu_k` (K), equation (28).
    pub degrees_of_freedom: Vec<f64>,
    /// `m_k` (K, D), equation (26).
    pub means: Vec<f64>,
    /// `W_k^-1` (K, D, D), equation (27).
    pub scale_inverses: Vec<f64>,
}

impl Posterior {
    /// The M step, (23) to (28).
    pub(super) fn maximised(prior: &Prior, moments: &Moments) -> Self {
        let d = moments.dimensions;
        let mut this = Self {
            dimensions: d,
            weight_concentration: moments.counts.iter().map(|n| prior.weight_concentration + n).collect(),
            mean_precision: moments.counts.iter().map(|n| prior.mean_precision + n).collect(),
            degrees_of_freedom: moments.counts.iter().map(|n| prior.degrees_of_freedom + n).collect(),
            means: prior.mean.repeat(moments.components()),
            scale_inverses: prior.scale_inverse.repeat(moments.components()),
        };
        for (k, count) in moments.counts.iter().copied().enumerate().filter(|(_, count)| *count > 0.0) {
            let share = count / this.mean_precision[k];
            let mean = &moments.means[k * d..(k + 1) * d];
            let matrix = &mut this.scale_inverses[k * d * d..(k + 1) * d * d];
            for i in 0..d {
                let off = mean[i] - prior.mean[i];
                this.means[k * d + i] = prior.mean[i] + share * off;
                for j in 0..d {
                    let spread = prior.mean_precision * share * off * (mean[j] - prior.mean[j]);
                    matrix[i * d + j] += moments.scatters[k * d * d + i * d + j] + spread;
                }
            }
        }
        this
    }

    /// K.
    pub fn components(&self) -> usize {
        self.weight_concentration.len()
    }

    /// Expected precisions `nu_k W_k` (K, D, D), from the factors that densities are computed with: symmetric
    /// and without a negative eigenvalue but for rounding, where the inverse of a matrix that rounding made
    /// singular has none.
    ///
    /// # Errors
    /// [`Error::Numerical`] for a matrix without a factor.
    pub fn precisions(&self) -> Result<Vec<f64>> {
        let d = self.dimensions;
        let factors = Factors::of(self)?;
        let mut out = Vec::with_capacity(self.scale_inverses.len());
        for (lower, nu) in factors.lower.chunks_exact(d * d).zip(&self.degrees_of_freedom) {
            let inverse = inverse_of_lower(lower, d);
            let product = |i: usize, j: usize| (0..d).map(|m| inverse[m * d + i] * inverse[m * d + j]).sum::<f64>();
            out.extend((0..d * d).map(|at| nu * product(at / d, at % d)));
        }
        Ok(out)
    }

    /// Only the components for which `keep` holds.
    pub fn retain(&mut self, keep: &[bool]) {
        let d = self.dimensions;
        let single = [&mut self.weight_concentration, &mut self.mean_precision, &mut self.degrees_of_freedom];
        for values in single {
            keep_rows(values, 1, keep);
        }
        keep_rows(&mut self.means, d, keep);
        keep_rows(&mut self.scale_inverses, d * d, keep);
    }

    /// The components renamed: component `k` is `names[k]` of the result.
    #[must_use]
    pub fn renamed(&self, names: &[usize]) -> Self {
        let d = self.dimensions;
        let mut out = self.clone();
        for (k, &name) in names.iter().enumerate() {
            out.weight_concentration[name] = self.weight_concentration[k];
            out.mean_precision[name] = self.mean_precision[k];
            out.degrees_of_freedom[name] = self.degrees_of_freedom[k];
            out.means[name * d..(name + 1) * d].copy_from_slice(&self.means[k * d..(k + 1) * d]);
            let (to, from) = (name * d * d, k * d * d);
            out.scale_inverses[to..to + d * d].copy_from_slice(&self.scale_inverses[from..from + d * d]);
        }
        out
    }

    /// With `by` taken off (`sign` -1) or put on (1) the means.
    pub(super) fn moved(mut self, by: &[f64], sign: f64) -> Self {
        for mean in self.means.chunks_exact_mut(self.dimensions) {
            mean.iter_mut().zip(by).for_each(|(m, c)| *m += sign * c);
        }
        self
    }

    /// Whether its parts fit together.
    ///
    /// # Errors
    /// [`Error::Argument`] named `start`.
    pub(super) fn check(&self, dimensions: usize) -> Result<()> {
        let k = self.components();
        let lengths = [
            self.mean_precision.len() == k,
            self.degrees_of_freedom.len() == k,
            self.dimensions == dimensions && self.means.len() == k * dimensions,
            self.scale_inverses.len() == k * dimensions * dimensions,
        ];
        let numbers = [&self.weight_concentration, &self.mean_precision, &self.degrees_of_freedom];
        let finite = self.means.iter().chain(&self.scale_inverses).all(|x| x.is_finite());
        let sound = finite && numbers.into_iter().flatten().all(|x| x.is_finite() && *x > 0.0);
        if k == 0 || lengths.contains(&false) || !sound {
            let expected = format!("components with finite parameters in {dimensions} dimensions");
            return Err(Error::argument(
                "start",
                expected,
                format!("{k} components in {} dimensions", self.dimensions),
            ));
        }
        Ok(())
    }

    /// Share of each component in the points (13), (N, K), row-major. Every row sums to 1.
    ///
    /// # Errors
    /// [`Error::Argument`] for points that are not finite or of another dimension, [`Error::Numerical`] for a
    /// matrix without a factor.
    pub fn responsibilities(&self, points: &Points) -> Result<Vec<f64>> {
        Ok(self.log_densities(points)?.1)
    }

    /// The component that each point belongs to: the one with the greatest share.
    pub fn labels(&self, points: &Points) -> Result<Vec<u32>> {
        let shares = self.responsibilities(points)?;
        let largest = |row: &[f64]| (0..row.len()).fold(0, |best, k| if row[k] > row[best] { k } else { best });
        Ok(shares.chunks_exact(self.components()).map(|row| largest(row) as u32).collect())
    }

    /// `ln sum_k rho_nk` of the points (N) by (14), and [`Posterior::responsibilities`].
    pub fn log_densities(&self, points: &Points) -> Result<(Vec<f64>, Vec<f64>)> {
        points.check_values()?;
        self.check(points.dimensions)?;
        Ok(Densities::of(self, &Factors::of(self)?).log_densities(points))
    }
}

impl Factors {
    /// Those of the `W_k^-1`.
    ///
    /// # Errors
    /// [`Error::Numerical`] for a matrix that cannot be mended.
    pub fn of(posterior: &Posterior) -> Result<Self> {
        Self::of_matrices(&posterior.scale_inverses, posterior.dimensions)
    }
}

impl Densities {
    /// Those of a posterior, (15) to (17).
    pub fn of(posterior: &Posterior, factors: &Factors) -> Self {
        let d = posterior.dimensions;
        let total = digamma(posterior.weight_concentration.iter().sum());
        let mut whitening = Vec::with_capacity(posterior.components() * d * (d + 1) / 2);
        let mut constants = Vec::with_capacity(posterior.components());
        for k in 0..posterior.components() {
            let nu = posterior.degrees_of_freedom[k];
            let log_pi = digamma(posterior.weight_concentration[k]) - total;
            let gammas: f64 = (0..d).map(|i| digamma((nu - i as f64) / 2.0)).sum();
            let log_precision = gammas + d as f64 * LN_2 - factors.log_determinants[k];
            let spread = d as f64 / posterior.mean_precision[k];
            constants.push(log_pi + 0.5 * (log_precision - d as f64 * TAU.ln() - spread));
            let inverse = inverse_of_lower(&factors.lower[k * d * d..(k + 1) * d * d], d);
            let scale = (0.5 * nu).sqrt();
            for i in 0..d {
                whitening.extend(inverse[i * d..=i * d + i].iter().map(|value| scale * value));
            }
        }
        Self { dimensions: d, constants, means: posterior.means.clone(), whitening }
    }
}
