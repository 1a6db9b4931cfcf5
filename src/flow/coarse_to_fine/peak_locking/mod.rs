//! Peak locking: bias of the motion by undersampled texture, measured in the frames and removed.
//!
//! Detail of more than half a cycle per pixel is recorded at a wrong wave number, `k - 2 pi` instead of `k`.
//! Shifting a frame by `d` px turns the true wave by `k d`, but the recorded one by `(k - 2 pi) d`. A pair is
//! warped by `-u / 2` and `u / 2`, so the remaining difference is proportional to `sin(pi u)`, and biases the
//! flow by `A sin(pi u)` towards half-integer displacements; where one frame is not warped (a triple, warped
//! by `-u`, 0 and `u`), by `A sin(2 pi u)`. It is strongest in particle images (M. Raffel et al., *Particle
//! Image Velocimetry*, on peak locking).
//!
//! `A` is a property of the texture and can be measured: in warped frames sampled half a pixel aside, the
//! aliased waves change their sign and everything else stays. Half the difference of the two right sides is
//! the contribution of the aliases, regressed here on the sine over patches all over the frame.

use super::data_term::{DataOptions, View};
use super::planes::{LEFT, Planes};
use super::pyramid::{ComparedFrames, PyramidLevel};
use crate::ablation::keeps;
use crate::math::{median, robust_std};
use crate::parallel;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use std::f64::consts::{PI, TAU};

/// Samples along a patch's side; the outermost only serve the stencils.
const SIDE: usize = 16;
const SAMPLES: usize = SIDE * SIDE;
const PATCHES: f64 = 48.0;
/// Minimum number of patches for a regression.
const MIN_PATCHES: usize = 4;
/// Scatter of a patch, standard deviations, at which its weight is a half; and repetitions with such weights.
const HALF_WEIGHT_SCATTER: f64 = 2.5;
const ROBUST_ROUNDS: usize = 5;
/// Maximum amplitude of peak locking, px.
const MAX_AMPLITUDE: f64 = 0.1;
/// Rows of one task.
const ROWS_PER_TASK: usize = 32;

/// Bias of the flow, `amplitude sin(2 pi cycles flow)` along each axis.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct PeakLocking {
    /// Amplitude, px.
    pub amplitude: [f64; 2],
    /// Variance of the amplitudes, px^2.
    pub variance: [f64; 2],
    /// Cycles per px of flow: 1/2 if both frames are warped halfway, 1 if one is not warped.
    pub cycles: f64,
}

impl PeakLocking {
    /// Measures the bias on the finest `level`; `residual_std` is for the robust weights of the rows.
    pub fn measure<T: SimdReal>(
        simd: Level,
        (level, compared): (&PyramidLevel<T>, ComparedFrames),
        motion: &Planes<T>,
        residual_std: Option<T>,
    ) -> Self {
        let views = level.views(compared);
        let has_unwarped = views.iter().any(|view| view.time.to_f64() == 0.0);
        let cycles = if has_unwarped { 1.0 } else { 0.5 };
        let (width, height) = level.size;
        let spacing = (((width * height) as f64 / PATCHES).sqrt() as usize).max(SIDE) & !1;
        let count = |len: usize| if len < SIDE { 0 } else { (len - SIDE) / spacing + 1 };
        let (columns, rows) = (count(width), count(height));
        let inverse = residual_std.map_or(0.0, |s| 1.0 / (DataOptions::default().robust * s.to_f64()).max(1e-15));
        let sums = parallel::map(0..columns * rows, |n| {
            // Centred in the remainder of the spacing.
            let start =
                |n: usize, count: usize, len: usize| n * spacing + (((len - SIDE - (count - 1) * spacing) / 2) & !1);
            let corner = (start(n % columns, columns, width), start(n / columns, rows, height));
            Patch::new(motion, corner, cycles).sums(simd, &views, (width, height), inverse)
        });
        let sums: Vec<[Sums; 2]> = sums.into_iter().flatten().collect();
        let mut found = Self { cycles, ..Self::default() };
        if sums.len() >= MIN_PATCHES {
            for c in 0..2 {
                (found.amplitude[c], found.variance[c]) = regress(&sums.iter().map(|s| s[c]).collect::<Vec<_>>());
            }
        }
        found
    }

    pub fn correct<T: SimdReal>(&self, simd: Level, motion: &mut Planes<T>) {
        if self.amplitude == [0.0; 2] {
            return;
        }
        let (stride, len) = (motion.stride(), motion.row_len().max(1));
        parallel::for_each(motion.data_mut().chunks_mut(ROWS_PER_TASK * len), |rows| {
            for row in rows.chunks_mut(len) {
                dispatch(simd, Correct { locking: self, row, stride });
            }
        });
    }

    /// Bias of flow and, per unit, derivatives as shares of the amplitude: `sin`, `2 pi cycles cos`.
    pub fn phase(&self, flow: f64) -> (f64, f64) {
        let (sine, cosine) = (TAU * self.cycles * flow).sin_cos();
        (sine, TAU * self.cycles * cosine)
    }
}

/// Amplitude and its variance, from the scatter of the patches' sums; the amplitude is shrunk by its scatter.
/// Patches that scatter more than the others (dead or saturated pixels, occlusions) have little weight.
fn regress(sums: &[Sums]) -> (f64, f64) {
    let known: Vec<&Sums> = sums.iter().filter(|s| s.weight > 0.0).collect();
    let Some(mut amplitude) = median(&mut known.iter().map(|s| s.product / s.weight).collect::<Vec<_>>()) else {
        return (0.0, 0.0);
    };
    let mut variance = 0.0;
    for _ in 0..ROBUST_ROUNDS {
        let scatter = |s: &Sums| (s.product - amplitude * s.weight) / s.weight.sqrt();
        let Some(scale) = robust_std(&mut known.iter().map(|s| scatter(s).abs()).collect::<Vec<_>>()) else {
            return (0.0, 0.0);
        };
        let inverse = 1.0 / (HALF_WEIGHT_SCATTER * scale).max(f64::MIN_POSITIVE);
        let inverse = if keeps("flow.robust_peak_locking") { inverse } else { 0.0 };
        let robust: Vec<f64> = known.iter().map(|s| 1.0 / (1.0 + (scatter(s) * inverse).powi(2))).collect();
        let weighted = || known.iter().zip(&robust);
        let (product, weight) =
            weighted().fold((0.0, 0.0), |(p, w), (s, share)| (p + share * s.product, w + share * s.weight));
        amplitude = product / weight;
        variance = weighted().map(|(s, share)| (share * (s.product - amplitude * s.weight)).powi(2)).sum::<f64>()
            / (weight * weight);
    }
    let kept = (1.0 - variance / (amplitude * amplitude).max(f64::MIN_POSITIVE)).max(0.0);
    ((kept * amplitude).clamp(-MAX_AMPLITUDE, MAX_AMPLITUDE), variance)
}

/// Contribution of one patch along one axis.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    /// Sine times right side.
    product: f64,
    /// Squared sine times normal equation.
    weight: f64,
}

struct Patch {
    corner: (usize, usize),
    flow: [[f64; SAMPLES]; 2],
    sine: [[f64; SAMPLES]; 2],
}

impl Patch {
    /// `corner` is a site.
    fn new<T: SimdReal>(motion: &Planes<T>, corner: (usize, usize), cycles: f64) -> Self {
        let mut flow = [[0.0; SAMPLES]; 2];
        let last = (motion.width - 1, motion.height - 1);
        for (k, flow) in flow.iter_mut().enumerate() {
            for (i, flow) in flow.iter_mut().enumerate() {
                let (x, y) = (corner.0 + i % SIDE, corner.1 + i / SIDE);
                let (right, below) = (x.div_ceil(2).min(last.0), y.div_ceil(2).min(last.1));
                let at = |x: usize, y: usize| motion.at(k, x, y).to_f64();
                *flow = 0.25 * (at(x / 2, y / 2) + at(right, y / 2) + at(x / 2, below) + at(right, below));
            }
        }
        let sine = flow.map(|flow| flow.map(|u| (TAU * cycles * u).sin()));
        Self { corner, flow, sine }
    }

    /// `None` where a frame is not usable.
    fn sums<T: SimdReal>(
        &self,
        simd: Level,
        views: &[View<'_, T>],
        size: (usize, usize),
        inverse: f64,
    ) -> Option<[Sums; 2]> {
        let here = self.warped(simd, views, size, [0.0, 0.0])?;
        let mut out = [Sums::default(); 2];
        for (c, out) in out.iter_mut().enumerate() {
            let shifted = self.warped(simd, views, size, if c == 0 { [0.5, 0.0] } else { [0.0, 0.5] })?;
            for y in 1..SIDE - 1 {
                for i in y * SIDE + 1..(y + 1) * SIDE - 1 {
                    let (residual, normal, right) = here.row(i, c);
                    let (_, normal_aside, right_aside) = shifted.row(i, c);
                    let robust = 1.0 / (1.0 + (residual * inverse).powi(2));
                    let sine = self.sine[c][i];
                    out.product += 0.5 * robust * sine * (right_aside - right);
                    out.weight += 0.5 * robust * sine * sine * (normal + normal_aside);
                }
            }
        }
        Some(out)
    }

    /// Mean and rate of the views at the pixels, `shift` px aside.
    fn warped<T: SimdReal>(
        &self,
        simd: Level,
        views: &[View<'_, T>],
        (width, height): (usize, usize),
        shift: [f64; 2],
    ) -> Option<Warped> {
        let mut out = Warped { mean: [0.0; SAMPLES], rate: [0.0; SAMPLES] };
        let (mut x, mut y) = ([T::from_f64(0.0); SAMPLES], [T::from_f64(0.0); SAMPLES]);
        let mut values = [T::from_f64(0.0); SAMPLES];
        for view in views {
            let time = view.time.to_f64();
            for i in 0..SAMPLES {
                let column = (self.corner.0 + i % SIDE) as f64 + shift[0] + time * self.flow[0][i];
                let row = (self.corner.1 + i / SIDE) as f64 + shift[1] + time * self.flow[1][i];
                let inside = column >= 1.0 && row >= 1.0 && column <= width as f64 - 2.0 && row <= height as f64 - 2.0;
                let usable =
                    inside && view.usable.is_none_or(|mask| mask.get(column.round() as usize, row.round() as usize));
                if !usable {
                    return None;
                }
                (x[i], y[i]) = (T::from_f64(column), T::from_f64(row));
            }
            view.spline.sample_row(simd, &x, &y, &mut values);
            let (mean, rate) = (view.mean.to_f64(), view.rate.to_f64());
            for (i, value) in values.iter().enumerate() {
                out.mean[i] += mean * value.to_f64();
                out.rate[i] += rate * value.to_f64();
            }
        }
        Some(out)
    }
}

struct Warped {
    mean: [f64; SAMPLES],
    rate: [f64; SAMPLES],
}

impl Warped {
    /// Residual, entry of the normal matrix and right side along the axis `c`, as in the data term.
    fn row(&self, i: usize, c: usize) -> (f64, f64, f64) {
        let gradient = DataOptions::default().gradient.powi(2);
        // Steps along the axis and across it.
        let (a, b) = if c == 0 { (1, SIDE) } else { (SIDE, 1) };
        let (mean, rate) = (&self.mean, &self.rate);
        let value = |p: &[f64; SAMPLES], i: usize, step: usize| (p[i - step] + 4.0 * p[i] + p[i + step]) * (1.0 / 6.0);
        let smooth = |p: &[f64; SAMPLES], [before, here, after]: [usize; 3], step: usize| {
            [value(p, before, step), value(p, here, step), value(p, after, step)]
        };
        let slope = |[before, _, after]: [f64; 3]| 0.5 * (after - before);
        let across = smooth(mean, [i - a, i, i + a], b);
        let (first, second) = (slope(across), across[0] - 2.0 * across[1] + across[2]);
        let mixed = 0.25 * (mean[i + a + b] - mean[i + a - b] - mean[i - a + b] + mean[i - a - b]);
        let rates = smooth(rate, [i - a, i, i + a], b);
        let (along, other) = (slope(rates), slope(smooth(rate, [i - b, i, i + b], a)));
        let residual = (rates[0] + 4.0 * rates[1] + rates[2]) / 6.0;
        let normal = first * first + gradient * (second * second + mixed * mixed);
        (residual, normal, first * residual + gradient * (second * along + mixed * other))
    }
}

struct Correct<'a, T> {
    locking: &'a PeakLocking,
    row: &'a mut [T],
    stride: usize,
}

impl<T: SimdReal> Kernel<T> for Correct<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { locking, row, stride } = self;
        let cycles = V::constant(locking.cycles);
        for k in 0..2 {
            let amplitude = V::constant(locking.amplitude[k]);
            let steepness = V::constant(TAU * locking.cycles * locking.amplitude[k]);
            for x in (LEFT..stride - LEFT).step_by(V::LANES) {
                let flow = V::load(&row[k * stride + x..]);
                let turns = flow * cycles;
                amplitude.neg_mul_add(sine(turns), flow).store(&mut row[k * stride + x..]);
                let factor = steepness.neg_mul_add(sine(turns + V::constant(0.25)), V::constant(1.0));
                for slope in [2 + k, 4 + k] {
                    let at = slope * stride + x;
                    (V::load(&row[at..]) * factor).store(&mut row[at..]);
                }
            }
        }
    }
}

/// `sin(2 pi turns)`, to 4e-6.
#[inline(always)]
fn sine<V: Lanes>(turns: V) -> V {
    let half = V::constant(0.5);
    let rest = turns - (turns + half).floor();
    // Folded into the quarters beside 0.
    let folded = rest.min(half - rest).max(V::zero() - half - rest);
    let angle = folded * V::constant(2.0 * PI);
    let square = angle * angle;
    let mut series = V::constant(1.0 / 362_880.0);
    for factor in [-1.0 / 5040.0, 1.0 / 120.0, -1.0 / 6.0, 1.0] {
        series = series.mul_add(square, V::constant(factor));
    }
    series * angle
}

#[cfg(test)]
mod tests;
