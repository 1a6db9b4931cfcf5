//! Curvature bias: loss of curved flow by smoothing.
//!
//! Motion smoothed once more, twice over, by a Gaussian G loses `(1 - G)^2` of itself. Where flow is curved
//! on the scale of the windows, this loss points along the error already present: in turbulence both
//! correlate by .7 to .85, flow and derivatives alike. The outer product of the loss, averaged around a node,
//! is the covariance; a share of that of the slopes is isotropic.
//!
//! There are two parts. The windows of data term and regularisation are the same everywhere, so their loss is
//! measured with a Gaussian of [`FIXED_SIGMA`]. The chosen windows differ, so the motion loses `(1 - G)^4`,
//! as it does in them, to Gaussians that are somewhat wider, with the weights of the windows.

use super::Entries;
use crate::flow::coarse_to_fine::data_term::MOTION;
use crate::flow::coarse_to_fine::nodes::binomial_mean;
use crate::flow::coarse_to_fine::planes::{Planes, SITE_SPACING};
use crate::flow::coarse_to_fine::refine::{SITES_PER_NODE, TERMS, WindowStatistics};
use crate::flow::symmetric::{ENTRIES, upper};
use crate::parallel;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use std::f64::consts::SQRT_2;

/// Standard deviation of the fixed Gaussian, px: about twice that of the windows chosen in curved flow.
const FIXED_SIGMA: f64 = 6.0;
/// Standard deviations of the other Gaussians over those of the windows.
const CHOSEN_SIGMA_FACTOR: f64 = 1.25;
/// Minimum sigma, px, of a window whose loss is measured separately.
const MIN_CHOSEN_SIGMA: f64 = 3.5;
/// Isotropic share of the slopes' squared errors: estimates of turbulence have divergence.
const ISOTROPIC_SHARE: f64 = 0.2;
/// The motion or its loss at a node.
type Loss = [f64; MOTION];

/// Errors over losses, of the flow and of the slopes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shares {
    pub fixed: [f64; 2],
    pub chosen: [f64; 2],
}

pub(super) fn curvature_bias<T: SimdReal>(
    simd: Level,
    motion: &Planes<T>,
    statistics: &WindowStatistics<T>,
    shares: Shares,
) -> Vec<Entries> {
    let size = statistics.size();
    let mut products = vec![[0.0; ENTRIES]; size.0 * size.1];
    for (losses, shares) in
        [(lost(simd, motion, size), shares.fixed), (lost_to_windows(simd, motion, statistics), shares.chosen)]
    {
        for (out, loss) in products.iter_mut().zip(losses) {
            add_loss(out, &loss, shares);
        }
    }
    binomial_mean(&mut products, size);
    products
}

fn add_loss(out: &mut Entries, loss: &Loss, shares: [f64; 2]) {
    let energy = shares[1].powi(2) * loss[2..].iter().map(|slope| slope * slope).sum::<f64>();
    let kept = [1.0, (1.0 - ISOTROPIC_SHARE).sqrt()];
    let scaled: Loss = std::array::from_fn(|k| loss[k] * shares[usize::from(k >= 2)] * kept[usize::from(k >= 2)]);
    for i in 0..MOTION {
        for j in i..MOTION {
            out[upper(i, j)] += scaled[i] * scaled[j];
        }
    }
    (2..MOTION).for_each(|k| out[upper(k, k)] += ISOTROPIC_SHARE * energy / 4.0);
}

pub(super) fn motion_at<T: SimdReal>(motion: &Planes<T>, (x, y): (usize, usize)) -> Loss {
    let (x, y) = ((SITES_PER_NODE * x).min(motion.width - 1), (SITES_PER_NODE * y).min(motion.height - 1));
    std::array::from_fn(|k| motion.at(k, x, y).to_f64())
}

/// `(1 - G)^2` of the motion at the nodes, G of [`FIXED_SIGMA`] px.
fn lost<T: SimdReal>(simd: Level, motion: &Planes<T>, (width, height): (usize, usize)) -> Vec<Loss> {
    // G and G G.
    let kernels = [FIXED_SIGMA / SITE_SPACING, FIXED_SIGMA / SITE_SPACING * SQRT_2];
    let along = kernels.map(|s| gaussians::<T>(s, (width, SITES_PER_NODE), motion.width));
    let across = kernels.map(|s| gaussians::<T>(s, (height, SITES_PER_NODE), motion.height));
    let rows: Vec<Vec<Loss>> = parallel::map(0..height, |y| {
        let mut lost: Vec<Loss> = (0..width).map(|x| motion_at(motion, (x, y))).collect();
        for (factor, (across, along)) in [-2.0, 1.0].into_iter().zip(across.iter().zip(&along)) {
            let sites = (across[y].first..).zip(across[y].weights.iter().map(|weight| weight.to_f64()));
            let down = motion.weighted_rows(simd, sites);
            for k in 0..MOTION {
                let down = down.line(k, 0);
                for (lost, taps) in lost.iter_mut().zip(along) {
                    lost[k] += factor * dot(&down[taps.first..], &taps.weights).to_f64();
                }
            }
        }
        lost
    });
    rows.concat()
}

/// Sum of products of the `weights` with as many values, in parts of known length, so that the compiler uses
/// lanes.
fn dot<T: SimdReal>(values: &[T], weights: &[T]) -> T {
    const PART: usize = 8;
    let zero = T::from_f64(0.0);
    let (values, last_values) = values[..weights.len()].as_chunks::<PART>();
    let (weights, last_weights) = weights.as_chunks::<PART>();
    let mut sums = [zero; PART];
    for (values, weights) in values.iter().zip(weights) {
        (0..PART).for_each(|i| sums[i] += weights[i] * values[i]);
    }
    for (sum, (&value, &weight)) in sums.iter_mut().zip(last_values.iter().zip(last_weights)) {
        *sum += weight * value;
    }
    sums.into_iter().sum()
}

/// The sum over the windows of weight times `(1 - G)^4` of the motion, G wider than the window by
/// [`CHOSEN_SIGMA_FACTOR`]. The motion there is smooth enough to be smoothed from node to node.
fn lost_to_windows<T: SimdReal>(simd: Level, motion: &Planes<T>, statistics: &WindowStatistics<T>) -> Vec<Loss> {
    let (width, height) = statistics.size();
    let nodes: Vec<(usize, usize)> = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).collect();
    let whole: Vec<Padded> = nodes.iter().map(|&at| padded(&motion_at(motion, at))).collect();
    let mut lost = vec![[0.0; MOTION]; whole.len()];
    let (mut left, mut rows) = (whole.clone(), whole.clone());
    for (l, sigma) in statistics.sigmas.iter().enumerate().filter(|(_, s)| **s >= MIN_CHOSEN_SIGMA) {
        let weights: Vec<[f64; 2]> = nodes.iter().map(|&(x, y)| statistics.weights(l, x, y)).collect();
        if weights.iter().flatten().all(|w| *w < 0.01) {
            continue;
        }
        left.copy_from_slice(&whole);
        let sigma = CHOSEN_SIGMA_FACTOR * sigma / (SITE_SPACING * SITES_PER_NODE as f64);
        let (along, across) = (gaussians(sigma, (width, 1), width), gaussians(sigma, (height, 1), height));
        for _ in TERMS {
            parallel::for_each(rows.chunks_mut(width).enumerate(), |(y, out)| {
                dispatch(simd, MeanAlong { from: &left[y * width..][..width], taps: &along, out });
            });
            parallel::for_each(left.chunks_mut(width).enumerate(), |(y, out)| {
                dispatch(simd, SubtractMean { rows: &rows, taps: &across[y], out });
            });
        }
        for ((lost, weight), left) in lost.iter_mut().zip(weights).zip(&left) {
            (0..MOTION).for_each(|k| lost[k] += weight[usize::from(k >= 2)] * left[k]);
        }
    }
    lost
}

/// A loss in memory that lanes of every length fill.
type Padded = [f64; 8];

fn padded(loss: &Loss) -> Padded {
    std::array::from_fn(|k| loss.get(k).copied().unwrap_or(0.0))
}

/// Means along a row of nodes.
struct MeanAlong<'a> {
    from: &'a [Padded],
    taps: &'a [Taps<f64>],
    out: &'a mut [Padded],
}

impl Kernel<f64> for MeanAlong<'_> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) {
        for (out, taps) in self.out.iter_mut().zip(self.taps) {
            let values = &self.from[taps.first..][..taps.weights.len()];
            for part in (0..out.len()).step_by(V::LANES) {
                let mut sum = V::zero();
                for (value, &weight) in values.iter().zip(&taps.weights) {
                    sum = V::load(&value[part..]).mul_add(V::splat(weight), sum);
                }
                sum.store(&mut out[part..]);
            }
        }
    }
}

/// Subtracts the means down the columns from a row of nodes.
struct SubtractMean<'a> {
    rows: &'a [Padded],
    taps: &'a Taps<f64>,
    out: &'a mut [Padded],
}

impl Kernel<f64> for SubtractMean<'_> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) {
        let Self { rows, taps, out } = self;
        for (row, &weight) in rows.chunks_exact(out.len()).skip(taps.first).zip(&taps.weights) {
            for (out, value) in out.iter_mut().zip(row) {
                for part in (0..out.len()).step_by(V::LANES) {
                    let left = V::load(&value[part..]).neg_mul_add(V::splat(weight), V::load(&out[part..]));
                    left.store(&mut out[part..]);
                }
            }
        }
    }
}

/// Weights of sites, from `first` on.
struct Taps<T> {
    first: usize,
    weights: Vec<T>,
}

/// A Gaussian of `sigma` sites about each of `nodes` positions, `spacing` apart. Beyond the edges values are
/// reflected at the point on the edge, so that affine motion has no loss.
fn gaussians<T: SimdReal>(sigma: f64, (nodes, spacing): (usize, usize), sites: usize) -> Vec<Taps<T>> {
    let radius = (3.0 * sigma).ceil() as isize;
    let raw: Vec<f64> = (-radius..=radius).map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp()).collect();
    let total: f64 = raw.iter().sum();
    let last = sites as isize - 1;
    (0..nodes)
        .map(|n| {
            let centre = ((spacing * n) as isize).min(last);
            let mut weights = vec![0.0; sites];
            for (k, w) in (-radius..=radius).zip(&raw) {
                let (at, w) = (centre + k, w / total);
                let edge = at.clamp(0, last);
                if at == edge {
                    weights[at as usize] += w;
                } else {
                    weights[edge as usize] += 2.0 * w;
                    weights[(2 * edge - at).clamp(0, last) as usize] -= w;
                }
            }
            let first = weights.iter().position(|w| *w != 0.0).unwrap_or(0);
            let end = weights.iter().rposition(|w| *w != 0.0).map_or(first, |last| last + 1);
            Taps { first, weights: weights[first..end].iter().map(|&w| T::from_f64(w)).collect() }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn affine_motion_loses_nothing_and_waves_lose_what_the_formula_says() {
        let (width, height) = (150, 120);
        let k = 0.3;
        let mut motion = Planes::<f64>::new(width, height, MOTION);
        for y in 0..height {
            for x in 0..width {
                let (px, py) = (SITE_SPACING * x as f64, SITE_SPACING * y as f64);
                motion.line_mut(0, y)[x] = 3.0 + 0.02 * px - 0.01 * py;
                motion.line_mut(1, y)[x] = (k * px).cos();
            }
        }
        let size = (width.div_ceil(SITES_PER_NODE), height.div_ceil(SITES_PER_NODE));
        let lost = lost(Level::SCALAR, &motion, size);
        assert!(lost.iter().all(|l| l[0].abs() < 1e-12));
        let g = (-0.5 * (k * FIXED_SIGMA).powi(2)).exp();
        for x in 8..size.0 - 8 {
            let want = (1.0 - g).powi(2) * (k * SITE_SPACING * (SITES_PER_NODE * x) as f64).cos();
            assert!((lost[15 * size.0 + x][1] - want).abs() < 0.01);
        }
    }
}
