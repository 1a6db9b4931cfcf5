//! Measurement from brightness: the fitted jet of each site, and what the fit leaves.

use super::kernel::BLOCK;
use super::kernel::update::{MEASURED, MISFIT, PRESENT, SHARE};
use crate::jet::JetStencil;
use crate::simd::{Kernel, Lanes, SimdReal};
use crate::types::Frame;

/// How far the residual must lie above what white noise of the given variance leaves, in standard deviations,
/// before it counts as structure that no quadratic describes.
const MISFIT_THRESHOLD: f64 = 3.0;

/// A neighbourhood's fit in working precision.
#[derive(Debug, Clone)]
pub(super) struct Fit<T> {
    /// Distance of each pixel from the site, in samples of a frame.
    offsets: Vec<isize>,
    /// Weight of each pixel in each component of the jet.
    weights: Vec<[T; 6]>,
    /// Row of the design matrix for each pixel.
    design: Vec<[T; 6]>,
    /// Expected sum of squared residuals for unit noise; zero if the fit has no degrees of freedom left.
    freedom: f64,
    /// Residual variance, grey levels squared, above which the quadratic does not describe the neighbourhood;
    /// the largest number if the filter does not adapt.
    threshold: f64,
}

impl<T: SimdReal> Fit<T> {
    pub(super) fn new(stencil: &JetStencil, frame_width: usize, noise: Option<f64>) -> Self {
        let (weights, design) = (stencil.weights(), stencil.design());
        let mut freedom = 0.0;
        for (o, row) in design.iter().enumerate() {
            for (p, w) in weights.iter().enumerate() {
                let hat: f64 = row.iter().zip(w).map(|(b, w)| b * w).sum();
                freedom += (f64::from(u8::from(o == p)) - hat).powi(2);
            }
        }
        let has_freedom = freedom >= 1e-9;
        let threshold = |noise: f64| noise * (1.0 + MISFIT_THRESHOLD * (2.0 / freedom).sqrt());
        Self {
            offsets: stencil.offsets().iter().map(|&(x, y)| y as isize * frame_width as isize + x as isize).collect(),
            weights: weights.iter().map(|w| w.map(T::from_f64)).collect(),
            design: design.iter().map(|b| b.map(T::from_f64)).collect(),
            freedom: if has_freedom { freedom } else { 0.0 },
            threshold: noise.filter(|_| has_freedom).map_or(f64::MAX, threshold),
        }
    }
}

/// Measures the sites of some blocks.
pub(super) struct Measure<'a, T> {
    pub frame: &'a Frame<T>,
    /// Index of each site's pixel in the frame, `BLOCK` for each block; neighbourhoods lie inside the frame.
    pub pixels: &'a [usize],
    pub fit: &'a Fit<T>,
    /// Factor from samples to grey levels.
    pub scale: T,
    /// Receives `MEASURED` rows of `BLOCK` for each block.
    pub measured: &'a mut [T],
    /// Receives the root mean square residual of each site.
    pub residual: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Measure<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let samples = self.frame.data();
        let (one, zero) = (V::constant(1.0), V::zero());
        let inverse = V::constant(if self.fit.freedom > 0.0 { 1.0 / self.fit.freedom } else { f64::NAN });
        let (threshold, scale) = (V::constant(self.fit.threshold), V::splat(self.scale));
        for (b, pixels) in self.pixels.chunks_exact(BLOCK).enumerate() {
            let measured = &mut self.measured[b * MEASURED * BLOCK..(b + 1) * MEASURED * BLOCK];
            // The last block of a narrow frame repeats its last pixel: both ends alone are not enough.
            let neighbours = pixels.windows(2).all(|pair| pair[1] == pair[0] + 1);
            for at in (0..BLOCK).step_by(V::LANES) {
                let pixels = &pixels[at..at + V::LANES];
                // Derivatives do not depend on a constant: differences from one sample keep all their digits.
                let base = fetch::<V>(samples, pixels, self.fit.offsets[0], neighbours);
                let (mut jet, mut sum, mut squares) = ([zero; 6], zero, zero);
                for (&offset, weights) in self.fit.offsets.iter().zip(&self.fit.weights) {
                    let z = fetch::<V>(samples, pixels, offset, neighbours) - base;
                    sum = sum + z;
                    squares = z.mul_add(z, squares);
                    for k in 0..6 {
                        jet[k] = z.mul_add(V::splat(weights[k]), jet[k]);
                    }
                }
                let mut left = zero;
                for (&offset, row) in self.fit.offsets.iter().zip(&self.fit.design) {
                    let mut z = fetch::<V>(samples, pixels, offset, neighbours) - base;
                    for k in 0..6 {
                        z = jet[k].neg_mul_add(V::splat(row[k]), z);
                    }
                    left = z.mul_add(z, left);
                }
                jet[0] = jet[0] + base;
                // Zero for finite numbers, NaN for others, with any weights.
                let mut spoilt = zero * left;
                for k in 0..6 {
                    spoilt = zero.mul_add(jet[k], spoilt);
                }
                let good = zero.lt(one + spoilt);
                for k in 0..6 {
                    V::select(good, jet[k] * scale, zero).store(&mut measured[k * BLOCK + at..]);
                }
                V::select(good, one, zero).store(&mut measured[PRESENT * BLOCK + at..]);
                let rms = (left * inverse).sqrt() * scale;
                rms.store(&mut self.residual[b * BLOCK + at..]);
                let variance = rms * rms;
                let misfit = V::select(threshold.lt(variance), variance, zero);
                V::select(good, misfit, zero).store(&mut measured[MISFIT * BLOCK + at..]);
                // A misfit is above zero only where the samples differ.
                let share = left / sum.neg_mul_add(sum * V::constant(1.0 / self.fit.offsets.len() as f64), squares);
                let share = V::select(zero.lt(misfit), share.min(one), zero);
                V::select(good, share, zero).store(&mut measured[SHARE * BLOCK + at..]);
            }
        }
    }
}

/// The samples at `offset` from each of the pixels.
#[inline(always)]
fn fetch<V: Lanes>(samples: &[V::Scalar], pixels: &[usize], offset: isize, neighbours: bool) -> V {
    if neighbours {
        return V::load(&samples[pixels[0].wrapping_add_signed(offset)..]);
    }
    let mut lanes = [V::Scalar::default(); BLOCK];
    for k in 0..V::LANES {
        lanes[k] = samples[pixels[k].wrapping_add_signed(offset)];
    }
    V::load(&lanes)
}
