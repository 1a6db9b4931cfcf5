//! A row of estimates with covariance and diagnostics, from a row of coefficients.
//!
//! Apart from the kernel of the plain estimate, so that the many registers these need do not slow it down,
//! and so that all neighbourhoods share one.

use super::lane_noise::LaneNoise;
use super::normal::{LaneRates, noise_square};
use super::propagation::factor_memory;
use super::uncertainty::{Detail, estimate_affine};
use crate::jet::starts;
use crate::simd::{Kernel, Lanes, SimdReal};

/// Rows of coefficients: the jet, minus i', i'', and the brightness.
pub(super) const RATES: usize = 18;

/// The coefficients of `len` sites: [`RATES`] rows, each `len` long.
pub(super) struct RatesRow<S> {
    pub values: S,
    pub len: usize,
}

impl<T: SimdReal> RatesRow<&mut [T]> {
    /// Stores the coefficients of the lanes from `x` on.
    #[inline(always)]
    pub fn put<V: Lanes<Scalar = T>>(&mut self, x: usize, rates: &LaneRates<V>, brightness: V) {
        let n = self.len;
        for k in 0..5 {
            rates.jet[k].store(&mut self.values[k * n + x..]);
        }
        for k in 0..6 {
            rates.minus_first[k].store(&mut self.values[(5 + k) * n + x..]);
            rates.second[k].store(&mut self.values[(11 + k) * n + x..]);
        }
        brightness.store(&mut self.values[17 * n + x..]);
    }

    /// Keeps every `stride`-th site, at the front of its row.
    pub fn thin(&mut self, stride: usize) {
        if stride > 1 {
            for row in self.values.chunks_exact_mut(self.len) {
                for k in 0..self.len.div_ceil(stride) {
                    row[k] = row[k * stride];
                }
            }
        }
    }
}

impl<T: SimdReal> RatesRow<&[T]> {
    #[inline(always)]
    fn get<V: Lanes<Scalar = T>>(&self, x: usize) -> (LaneRates<V>, V) {
        let n = self.len;
        let mut rates = LaneRates { jet: [V::zero(); 5], minus_first: [V::zero(); 6], second: [V::zero(); 6] };
        for k in 0..5 {
            rates.jet[k] = V::load(&self.values[k * n + x..]);
        }
        for k in 0..6 {
            rates.minus_first[k] = V::load(&self.values[(5 + k) * n + x..]);
            rates.second[k] = V::load(&self.values[(11 + k) * n + x..]);
        }
        (rates, V::load(&self.values[17 * n + x..]))
    }
}

/// Sites whose covariance is collected before it goes to its planes: these are often a multiple of 4 KiB
/// apart, and a vector written to each in turn would drive the one before it out of the first-level cache.
const BLOCK: usize = 64;
/// Values from one entry of the covariance to the next, for the same reason not a power of two.
const BLOCK_STEP: usize = BLOCK + 16;
/// Values of working memory of a [`DetailKernel`].
pub(super) const BLOCK_LEN: usize = 21 * BLOCK_STEP;

/// The estimates of the first sites of a row of coefficients.
pub(super) struct DetailKernel<'a, T> {
    pub rates: RatesRow<&'a [T]>,
    pub noise: &'a LaneNoise<T>,
    pub detail: Detail,
    /// A slice a parameter, as long as there are sites.
    pub motion: [&'a mut [T]; 6],
    /// A slice an entry, or nothing.
    pub covariance: Vec<&'a mut [T]>,
    /// Root mean square residual, and condition number.
    pub residual: Option<&'a mut [T]>,
    pub condition: Option<&'a mut [T]>,
    pub trust: &'a mut [T],
    /// Working memory, [`BLOCK_LEN`] values.
    pub block: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for DetailKernel<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        if self.trust.len() >= V::LANES {
            self.lanes::<V>();
        } else {
            self.lanes::<T>();
        }
    }
}

impl<T: SimdReal> DetailKernel<'_, T> {
    #[inline(always)]
    fn lanes<V: Lanes<Scalar = T>>(mut self) {
        let samples = noise_square::<T>();
        let mut memory = factor_memory::<V>();
        let n = self.trust.len();
        let size = n.min(BLOCK);
        for from in starts(0..n, size) {
            for x in starts(0..size, V::LANES) {
                let (rates, brightness) = self.rates.get::<V>(from + x);
                let estimate =
                    estimate_affine::<T, V>(&rates, brightness, samples, self.noise, self.detail, &mut memory);
                for (k, value) in estimate.covariance.into_iter().enumerate() {
                    value.store(&mut self.block[k * BLOCK_STEP + x..]);
                }
                for (out, value) in self.motion.iter_mut().zip(estimate.motion) {
                    value.store(&mut out[from + x..]);
                }
                if let Some(out) = &mut self.residual {
                    (estimate.residual_square * V::constant(1.0 / 12.0)).sqrt().store(&mut out[from + x..]);
                }
                if let Some(out) = &mut self.condition {
                    estimate.condition.store(&mut out[from + x..]);
                }
                estimate.trust.store(&mut self.trust[from + x..]);
            }
            for (plane, values) in self.covariance.iter_mut().zip(self.block.chunks_exact(BLOCK_STEP)) {
                plane[from..from + size].copy_from_slice(&values[..size]);
            }
        }
    }
}
