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

use super::data_term::{DataOptions, View, is_usable};
use super::planes::{LEFT, Planes};
use super::pyramid::{ComparedFrames, PyramidLevel};
use crate::ablation::keeps;
use crate::math::{median, robust_std};
use crate::parallel;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use crate::types::Mask;
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
    cycles: f64,
}

impl Patch {
    /// `corner` is a site.
    fn new<T: SimdReal>(motion: &Planes<T>, corner: (usize, usize), cycles: f64) -> Self {
        let mut flow = [[0.0; SAMPLES]; 2];
        let last = (motion.width - 1, motion.height - 1);
        for (k, flow) in flow.iter_mut().enumerate() {
            for (y, flow) in (corner.1..).zip(flow.chunks_exact_mut(SIDE)) {
                let [upper, lower] = [y / 2, y.div_ceil(2).min(last.1)].map(|y| motion.line(k, y));
                for (x, flow) in (corner.0..).zip(flow) {
                    let (left, right) = (x / 2, x.div_ceil(2).min(last.0));
                    let around = [upper[left], upper[right], lower[left], lower[right]];
                    *flow = 0.25 * around.map(T::to_f64).iter().sum::<f64>();
                }
            }
        }
        Self { corner, flow, cycles }
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
        for (axis, out) in out.iter_mut().enumerate() {
            let aside = self.warped(simd, views, size, if axis == 0 { [0.5, 0.0] } else { [0.0, 0.5] })?;
            let (flow, cycles) = (&self.flow[axis], self.cycles);
            *out = dispatch(simd, SumRows { here: &here, aside: &aside, axis, flow, cycles, inverse });
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
        let mut out = Warped { mean: [0.0; PADDED], rate: [0.0; PADDED] };
        let (mut x, mut y) = ([T::from_f64(0.0); SAMPLES], [T::from_f64(0.0); SAMPLES]);
        let mut values = [T::from_f64(0.0); SAMPLES];
        let corner = [self.corner.0 as f64 + shift[0], self.corner.1 as f64 + shift[1]];
        let (right, low) = (width as f64 - 2.0, height as f64 - 2.0);
        for view in views {
            let time = view.time.to_f64();
            let mut is_inside = true;
            for i in 0..SAMPLES {
                let column = corner[0] + (i % SIDE) as f64 + time * self.flow[0][i];
                let row = corner[1] + (i / SIDE) as f64 + time * self.flow[1][i];
                // Without a short circuit, so that the compiler uses lanes.
                is_inside &= column >= 1.0;
                is_inside &= row >= 1.0;
                is_inside &= column <= right;
                is_inside &= row <= low;
                (x[i], y[i]) = (T::from_f64(column), T::from_f64(row));
            }
            let is_usable = |mask: &Mask| x.iter().zip(&y).all(|(&x, &y)| is_usable(mask, x, y));
            if !is_inside || !view.usable.is_none_or(is_usable) {
                return None;
            }
            view.spline.sample_row(simd, &x, &y, &mut values);
            for (out, share) in [(&mut out.mean, view.mean), (&mut out.rate, view.rate)] {
                let share = share.to_f64();
                out[SIDE..].iter_mut().zip(&values).for_each(|(out, value)| *out += share * value.to_f64());
            }
        }
        Some(out)
    }
}

/// Samples of a patch, with a row of zeros on either side.
const PADDED: usize = SAMPLES + 2 * SIDE;
/// 1 on the columns of a patch that have neighbours.
const INNER: [f64; SIDE] = {
    let mut inner = [1.0; SIDE];
    (inner[0], inner[SIDE - 1]) = (0.0, 0.0);
    inner
};

struct Warped {
    mean: [f64; PADDED],
    rate: [f64; PADDED],
}

/// Sums over the inner samples of a patch, from its views `here` and half a pixel `aside` along the axis.
struct SumRows<'a> {
    here: &'a Warped,
    aside: &'a Warped,
    axis: usize,
    flow: &'a [f64; SAMPLES],
    cycles: f64,
    /// 1 / (c s), the inverse of the residual at which a pixel has weight 1/2.
    inverse: f64,
}

impl Kernel<f64> for SumRows<'_> {
    type Output = Sums;
    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) -> Sums {
        let Self { here, aside, axis, flow, cycles, inverse } = self;
        let (mut product, mut weight) = (V::zero(), V::zero());
        for i in (SIDE..SAMPLES - SIDE).step_by(V::LANES) {
            let (residual, normal, right) = row::<V>(here, SIDE + i, axis);
            let (_, normal_aside, right_aside) = row::<V>(aside, SIDE + i, axis);
            let deviation = residual * V::splat(inverse);
            let robust = V::constant(0.5) / deviation.mul_add(deviation, V::constant(1.0));
            let sine = sine(V::load(&flow[i..]) * V::splat(cycles)) * V::load(&INNER[i % SIDE..]);
            let share = robust * sine;
            product = share.mul_add(right_aside - right, product);
            weight = (share * sine).mul_add(normal + normal_aside, weight);
        }
        let sum = |lanes: V| {
            let mut values = [0.0; SIDE];
            lanes.store(&mut values);
            values.iter().sum()
        };
        Sums { product: sum(product), weight: sum(weight) }
    }
}

/// Residual, entry of the normal matrix and right side along an axis, as in the data term, at the samples
/// from `at` on.
#[inline(always)]
fn row<V: Lanes<Scalar = f64>>(warped: &Warped, at: usize, axis: usize) -> (V, V, V) {
    let gradient = V::constant(DataOptions::default().gradient.powi(2));
    let half = V::constant(0.5);
    // Steps along the axis and across it.
    let (a, b) = if axis == 0 { (1, SIDE) } else { (SIDE, 1) };
    let (mean, rate) = (around::<V>(&warped.mean, at, (a, b)), around::<V>(&warped.rate, at, (a, b)));
    let across = [value(mean[0]), value(mean[1]), value(mean[2])];
    let (first, second) = (half * (across[2] - across[0]), across[0] + across[2] - (across[1] + across[1]));
    let mixed = V::constant(0.25) * (mean[2][2] - mean[2][0] - mean[0][2] + mean[0][0]);
    let rates = [value(rate[0]), value(rate[1]), value(rate[2])];
    let (before, after) = ([rate[0][0], rate[1][0], rate[2][0]], [rate[0][2], rate[1][2], rate[2][2]]);
    let (along, other) = (half * (rates[2] - rates[0]), half * (value(after) - value(before)));
    let residual = value(rates);
    let normal = first.mul_add(first, gradient * second.mul_add(second, mixed * mixed));
    (residual, normal, first.mul_add(residual, gradient * second.mul_add(along, mixed * other)))
}

/// Samples one step before, at and after `at` along the axis, each with those across it.
#[inline(always)]
fn around<V: Lanes<Scalar = f64>>(plane: &[f64; PADDED], at: usize, (a, b): (usize, usize)) -> [[V; 3]; 3] {
    let load = |at: usize| V::load(&plane[at..]);
    let mut out = [[V::zero(); 3]; 3];
    for (line, at) in out.iter_mut().zip([at - a, at, at + a]) {
        *line = [load(at - b), load(at), load(at + b)];
    }
    out
}

/// `[1, 4, 1] / 6`.
#[inline(always)]
fn value<V: Lanes>([before, here, after]: [V; 3]) -> V {
    here.mul_add(V::constant(4.0), before + after) * V::constant(1.0 / 6.0)
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
