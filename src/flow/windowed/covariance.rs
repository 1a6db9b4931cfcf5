//! Covariance of the windowed estimate: what pixel noise does to it, and its bias (`docs/local_flow.md`).
//!
//! **Noise.** `s2 N^-1 S N^-1` with S from [`super::scores`]. Unless it is given, `s2` is the second
//! residual's sum of squares over its expectation; motion boundaries and changes of lighting raise it.
//!
//! **Bias.** The second estimate is of frames carried along the first, the third of one frame alone with the
//! motion of each pixel: its difference k to the first shows flow that is not affine. Both are of rows 1-6.
//!
//! **Where noise passes for structure** it adds E to N on average, so that along an eigenvector of `N^-1 E`
//! with eigenvalue a the estimate is `1 - a` of the motion. Along an edge or a grating a is near 1 and the
//! estimate near zero for every motion. Undoing the attenuation widens the covariance by `1 / (1 - a)`.

use super::estimate::{INVERSE, MOTION, RESIDUAL, Strip, WEIGHT};
use super::moments::Moments;
use super::noise::PixelNoise;
use super::plan::Plan;
use super::solve::normal_matrix;
use super::tile::TILE_COLUMNS;
use crate::ablation::keeps;
use crate::flow::symmetric::{ENTRIES, entry, factor, upper};
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use nalgebra::{Matrix6, SymmetricEigen};

/// Noise in no direction exceeds this share of the equations where the shares add up to less.
const MIN_TOTAL_SHARE: f64 = 0.5;
/// Floor of `1 - share`: closer to 1, shares are rounding errors.
const MIN_SIGNAL_SHARE: f64 = 1e-2;
/// What fits take of the noise in the second residual, in units of `tr(N^-1 S)`: 1 by its own and the rest by
/// those of each pixel. With this value noise that is given and noise from the frames agree.
const FITTED_TRACES: f64 = 1.6;
/// Smallest share of the residual's expectation that the fit leaves; with 0.05 sites in corners are too sure.
const MIN_RESIDUAL_SHARE: f64 = 0.35;
/// Smallest share of the window on usable pixels for the noise in its equations to be that of a whole window.
const MIN_WHOLE_WEIGHT: f64 = 0.75;
/// Share of the squared bias that is not noise of its estimate.
const BIAS_WEIGHT: f64 = 0.4;
/// The third estimate shows curvature beyond so many times what noise makes of its difference to the first.
const CURVATURE_THRESHOLD: f64 = 2.0;

/// Rows of the pixels' values: inverse normal matrix, the three estimates, the first's weight, the
/// residuals of the first two.
const ESTIMATES: usize = ENTRIES;
const USABLE: usize = ESTIMATES + 18;
const RESIDUALS: usize = USABLE + 1;
/// Then the result, the noise's part of it, the variance of the noise and its share in the equations.
const RESULT: usize = RESIDUALS + 2;
const NOISE: usize = RESULT + ENTRIES;
const VARIANCE: usize = NOISE + ENTRIES;
const SHARE: usize = VARIANCE + 1;
const ROWS: usize = SHARE + 1;

/// From the sums of one row of a tile to its covariances, with `pixel` for the values of its pixels.
///
/// Writes to `out`, rows of `width` values, from column `to` on: the covariance of `count` pixels whose
/// S is row `g` of `sums`, and after it what is left without the noise, if there are so many rows. The
/// pixels lie along image row `y` from column `left` on, where all three estimates are.
pub(super) fn write_covariances<T: SimdReal>(
    pixel: &mut Vec<T>,
    level: Level,
    noise: &PixelNoise,
    (plan, sums, g): (Plan, &Moments<T>, usize),
    (strips, left, y): ([&Strip<T>; 3], usize, usize),
    (out, width, to, count): (&mut [T], usize, usize, usize),
) {
    pixel.resize(ROWS * TILE_COLUMNS, T::default());
    let planes = (0..ENTRIES).map(|k| (0, INVERSE + k)).chain((0..18).map(|k| (k / 6, MOTION + k % 6)));
    let planes = planes.chain([(0, WEIGHT), (0, RESIDUAL), (1, RESIDUAL)]);
    for (target, (strip, plane)) in pixel.chunks_exact_mut(TILE_COLUMNS).zip(planes) {
        let grid = &strips[strip].grid;
        let Some(j) = grid.place(y) else { continue };
        target[..count].copy_from_slice(&grid.row(plane, j)[left - grid.columns.start..][..count]);
    }
    dispatch(level, Combine { noise, plan, sums, g, pixel: &mut *pixel });
    for c in 0..count {
        let at = |row: usize| pixel[row * TILE_COLUMNS + c].to_f64();
        let noisy = at(SHARE) > MIN_TOTAL_SHARE && at(SHARE).is_finite() && at(USABLE) > MIN_WHOLE_WEIGHT;
        if noisy && keeps("windowed.noise_dominated") {
            inflate(pixel, noise, c);
        }
    }
    for (k, row) in out.chunks_exact_mut(width).enumerate() {
        let part = |first: usize| &pixel[(first + k % ENTRIES) * TILE_COLUMNS..][..count];
        row[to..to + count].copy_from_slice(part(RESULT));
        if k >= ENTRIES {
            row[to..].iter_mut().zip(part(NOISE)).for_each(|(whole, noise)| *whole -= *noise);
        }
    }
}

/// Widens the covariance of pixel `c` along the directions that only noise determines.
fn inflate<T: SimdReal>(pixel: &mut [T], noise: &PixelNoise, c: usize) {
    let at = |k: usize| pixel[k * TILE_COLUMNS + c].to_f64();
    let matrix = |first: usize| Matrix6::from_fn(|i, j| at(first + upper(i.min(j), i.max(j))));
    let added = noise.normal * (at(VARIANCE) * at(USABLE));
    let Some(root) = matrix(0).cholesky().map(|factor| factor.l()) else { return };
    let Some(back) = root.try_inverse() else { return };
    // N^-1 E is similar to the symmetric L^T E L, N^-1 = L L^T.
    let shares = SymmetricEigen::new(root.transpose() * added * root);
    let s = noise.scale;
    let unit = Matrix6::from_diagonal(&[1.0, 1.0, s, s, s, s].into());
    let Some(unit_back) = unit.try_inverse() else { return };
    // What undoing the attenuation adds: `1 / (1 - a)`, without what small shares do, which is a bias.
    let added = |a: f64| a.clamp(0.0, 1.0).powi(4) / (1.0 - a).max(MIN_SIGNAL_SHARE);
    let gain = Matrix6::from_diagonal(&shares.eigenvalues.map(added));
    let spread = unit * root * shares.eigenvectors * gain * shares.eigenvectors.transpose() * back * unit_back;
    let covariance = matrix(RESULT);
    let wider = covariance + spread * covariance * spread.transpose();
    for (i, j) in (0..6).flat_map(|i| (i..6).map(move |j| (i, j))) {
        pixel[(RESULT + upper(i, j)) * TILE_COLUMNS + c] = T::from_f64(wider[(i, j)]);
    }
}

/// `s2 N^-1 S N^-1 + b b^T` for one row of a tile.
struct Combine<'a, T> {
    noise: &'a PixelNoise,
    plan: Plan,
    sums: &'a Moments<T>,
    g: usize,
    pixel: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Combine<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { noise, plan, sums, g, pixel } = self;
        let mut c = 0;
        while c < TILE_COLUMNS {
            let at = |k: usize| V::load(&pixel[k * TILE_COLUMNS + c..]);
            let inverse: [V; ENTRIES] = std::array::from_fn(at);
            // Without an estimate of the carried frames there is only the first residual.
            let known = V::constant(-1.0).lt(at(RESIDUALS + 1));
            let squares = V::select(known, at(RESIDUALS + 1), at(RESIDUALS));
            let fitted = V::select(known, V::constant(FITTED_TRACES), V::constant(1.0));
            let estimate = |which: usize, k: usize| at(ESTIMATES + 6 * which + k);
            let reliable = |value: V| V::select(known, value, V::zero());
            let curvature: [V; 6] = std::array::from_fn(|k| reliable(estimate(2, k) - estimate(0, k)));
            let bias: [V; 6] = std::array::from_fn(|k| reliable(estimate(1, k)) + curvature[k]);
            let weight = at(USABLE);
            let score = normal_matrix::<V, T>(plan, sums, (g, c));
            // N^-1 S, of which N^-1 S N^-1 is made.
            let spread: [[V; 6]; 6] =
                std::array::from_fn(|i| std::array::from_fn(|k| sum(|l| (entry(&inverse, i, l), entry(&score, l, k)))));
            let trace = (0..6).fold(V::zero(), |sum, i| sum + spread[i][i]);
            let variance = noise.variance.map_or_else(
                || {
                    let expected = V::constant(noise.residual) * weight;
                    let left = (expected - trace * fitted).max(expected * V::constant(MIN_RESIDUAL_SHARE));
                    (squares / left).max(V::constant(noise.min_variance))
                },
                |given| V::constant(given),
            );
            // tr(N^-1 E), at least the noise's largest share of any direction's equations.
            let added = |i: usize, k: usize| V::constant(noise.normal[(i, k)]);
            let share = (0..6).fold(V::zero(), |all, i| all + sum(|k| (entry(&inverse, i, k), added(k, i))));
            let mut put = |row: usize, value: V| value.store(&mut pixel[row * TILE_COLUMNS + c..]);
            put(VARIANCE, variance);
            put(SHARE, share * variance * weight);
            let mut scatter = [V::zero(); ENTRIES];
            for i in 0..6 {
                for k in i..6 {
                    scatter[upper(i, k)] = sum(|l| (spread[i][l], entry(&inverse, l, k))) * variance;
                }
            }
            let mut whole = scatter;
            for i in 0..6 {
                for k in i..6 {
                    let square = bias[i] * bias[k];
                    whole[upper(i, k)] = square.mul_add(V::constant(BIAS_WEIGHT), scatter[upper(i, k)]);
                }
            }
            // Squared curvature in units of what the covariance holds already.
            let scaled = factor(&whole).solve(&curvature);
            let square = sum(|k| (scaled[k], curvature[k]));
            let excess = (square - V::constant(CURVATURE_THRESHOLD * noise.curvature)).max(V::zero());
            let inflation = V::constant(1.0) + excess;
            for i in 0..6 {
                for k in i..6 {
                    let unit = [i, k].iter().map(|a| if *a < 2 { 1.0 } else { noise.scale }).product();
                    let unit = V::constant(unit);
                    put(NOISE + upper(i, k), scatter[upper(i, k)] * unit);
                    put(RESULT + upper(i, k), whole[upper(i, k)] * inflation * unit);
                }
            }
            c += V::LANES;
        }
    }
}

/// `sum_k a_k b_k` over six pairs.
#[inline(always)]
fn sum<V: Lanes>(pair: impl Fn(usize) -> (V, V)) -> V {
    (0..6).fold(V::zero(), |sum, k| {
        let (a, b) = pair(k);
        a.mul_add(b, sum)
    })
}
