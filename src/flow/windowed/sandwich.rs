//! The covariance of one row of pixels, from what the passes have summed for them.

use super::noise::PixelNoise;
use super::noise_setting::NoiseSetting;
use super::solve::{MomentRow, normal_matrix};
use super::tile::TILE_COLUMNS;
use crate::ablation::keeps;
use crate::flow::symmetric::{ENTRIES, upper};
use crate::simd::{Kernel, Lanes, SimdReal};

/// Rows of the planes of a row of pixels, that the covariance is computed in.
pub(super) const PIXEL: usize = PIXEL_NOISE + ENTRIES;
/// Where the noise's part of the result begins.
pub(super) const PIXEL_NOISE: usize = PIXEL_SHARE + 2;
/// Where the noise's share of the equations stands, and the variance of the noise.
pub(super) const PIXEL_SHARE: usize = PIXEL_RESULT + ENTRIES;
/// Where the result begins among them.
pub(super) const PIXEL_RESULT: usize = PIXEL_MISFIT + 12 + 3;
/// Where the misfit's scores begin: six entries of the truncation's, six of the flow's, the truncation's
/// energy, the energy of the detail and the weight of the pixels that have detail.
pub(super) const PIXEL_MISFIT: usize = ENTRIES + 6 + 2 + 6;

/// Fixed-point steps towards the true motion in the pull of the noise.
const PULL_STEPS: usize = 3;
/// Two estimates of the noise from one window may differ by so much by chance.
const NOISE_RATIO: f64 = 1.5;
/// What noise alone makes of the sum of squares of the six biases by curvature, each in units of its
/// deviation: rarely more than this.
const BEND_CHANCE: f64 = 6.0;
/// That bias is known to leading order, and from estimates that share it: its square counts so many times.
const BEND_WEIGHT: f64 = 2.0;

/// `s2 N^-1 S N^-1` and the pull, for one row of a tile.
pub(super) struct Sandwich<'a, T> {
    pub setting: &'a NoiseSetting<T>,
    pub row: MomentRow<'a, T>,
    pub pixel: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Sandwich<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { setting, row, pixel } = self;
        let noise = &setting.pixel;
        let mut c = 0;
        while c < TILE_COLUMNS {
            let at = |k: usize| V::load(&pixel[k * TILE_COLUMNS + c..]);
            let inverse: [V; ENTRIES] = std::array::from_fn(at);
            let m: [V; 6] = std::array::from_fn(|k| at(ENTRIES + k));
            let ones: [V; 6] = std::array::from_fn(|k| at(ENTRIES + 8 + k));
            let misfit: [V; 6] = std::array::from_fn(|k| at(PIXEL_MISFIT + k));
            let carried: [V; 6] = std::array::from_fn(|k| at(PIXEL_MISFIT + 6 + k));
            let score = normal_matrix::<V, T>(setting.plan(), &row, c);
            // N^-1 S, of which N^-1 S N^-1 is made.
            let spread: [[V; 6]; 6] = std::array::from_fn(|i| {
                std::array::from_fn(|k| sum(|l| (symmetric(&inverse, i, l), symmetric(&score, l, k))))
            });
            let scatter = |i: usize, k: usize| sum(|l| (spread[i][l], symmetric(&inverse, l, k)));
            let trace = (0..6).fold(V::zero(), |sum, i| sum + spread[i][i]);
            let (of_noise, variance) = variances(setting, &m, trace, &at);
            // tr(N^-1 E), at least the noise's largest share of any direction's equations.
            let entry = |i, k| noise_entry::<V>(&noise.quadratic, &ones, (i, k));
            let share = (0..6).fold(V::zero(), |all, i| all + sum(|k| (symmetric(&inverse, i, k), entry(k, i))));
            // The pull acts on the true motion, which is what is left after undoing it.
            let mut shift = [V::zero(); 6];
            for _ in 0..PULL_STEPS {
                let truth: [V; 6] = std::array::from_fn(|k| m[k] + shift[k]);
                let pull = pull::<V>(noise, &ones, &truth);
                let pull: [V; 6] = std::array::from_fn(|k| {
                    scaled("windowed.noise_pull", pull[k]).mul_add(of_noise, scaled("windowed.truncation", misfit[k]))
                });
                shift = std::array::from_fn(|i| sum(|k| (symmetric(&inverse, i, k), pull[k])));
            }
            let bend: [V; 6] = std::array::from_fn(|i| sum(|k| (symmetric(&inverse, i, k), carried[k])) - m[i]);
            let seen = (0..6).fold(V::zero(), |sum, i| sum + bend[i] * bend[i] / (scatter(i, i) * of_noise));
            let certain = (V::constant(1.0) - V::constant(BEND_CHANCE) / seen).max(V::zero());
            let certain = scaled("windowed.curvature", certain * V::constant(BEND_WEIGHT));
            (share * of_noise).store(&mut pixel[PIXEL_SHARE * TILE_COLUMNS + c..]);
            of_noise.store(&mut pixel[(PIXEL_SHARE + 1) * TILE_COLUMNS + c..]);
            for i in 0..6 {
                for k in i..6 {
                    let biases = (bend[i] * bend[k]).mul_add(certain, shift[i] * shift[k]);
                    let whole = scatter(i, k).mul_add(variance, biases);
                    let unit = (if i < 2 { 1.0 } else { setting.scale }) * if k < 2 { 1.0 } else { setting.scale };
                    let target = (PIXEL_RESULT + upper(i, k)) * TILE_COLUMNS + c;
                    (whole * V::constant(unit)).store(&mut pixel[target..]);
                    if setting.parts {
                        let target = (PIXEL_NOISE + upper(i, k)) * TILE_COLUMNS + c;
                        (scatter(i, k) * of_noise * V::constant(unit)).store(&mut pixel[target..]);
                    }
                }
            }
            c += V::LANES;
        }
    }
}

/// The value where the heuristic `rule` acts, else zero.
#[inline(always)]
fn scaled<V: Lanes>(rule: &str, value: V) -> V {
    if keeps(rule) { value } else { V::zero() }
}

/// The variance of the noise, and of all that varies from pixel to pixel: `trace` is tr(N^-1 S), `at` reads
/// rows of `Scratch::pixel`.
#[inline(always)]
fn variances<T: SimdReal, V: Lanes<Scalar = T>>(
    setting: &NoiseSetting<T>,
    m: &[V; 6],
    trace: V,
    at: &impl Fn(usize) -> V,
) -> (V, V) {
    if let Some(v) = setting.variance {
        return (V::constant(v), V::constant(v));
    }
    let (residual, weight) = (at(ENTRIES + 6), at(ENTRIES + 7));
    let [truncated, energy, known] = std::array::from_fn(|k| at(PIXEL_MISFIT + 12 + k));
    let chance = V::constant(NOISE_RATIO);
    let expected = one_pixel::<V>(&setting.pixel, m) * weight;
    let left = (expected - trace).max(expected * V::constant(0.05));
    let whole = residual / left;
    let unexplained = (residual - truncated) / (left * chance);
    let fine = energy / (known * V::constant(setting.high_frequency_gain));
    let enough = (weight * V::constant(0.5)).lt(known);
    let most = whole * chance;
    let least = V::constant(setting.min_variance);
    if !keeps("windowed.high_frequencies") {
        return (whole.max(least), whole.max(least));
    }
    if !keeps("windowed.residual") {
        let only = V::select(enough, fine, whole).max(least);
        return (only, only);
    }
    let of_noise = V::select(enough, most.min(fine), whole).max(least);
    (of_noise, V::select(enough, most.min(fine.max(unexplained)), whole).max(least))
}

/// `sum_k a_k b_k` over six pairs.
#[inline(always)]
fn sum<V: Lanes>(pair: impl Fn(usize) -> (V, V)) -> V {
    (0..6).fold(V::zero(), |sum, k| {
        let (a, b) = pair(k);
        a.mul_add(b, sum)
    })
}

/// Entry (i, j) of a symmetric matrix kept as its upper triangle.
#[inline(always)]
fn symmetric<V: Lanes>(list: &[V; ENTRIES], i: usize, j: usize) -> V {
    list[if i <= j { upper(i, j) } else { upper(j, i) }]
}

/// Expected squared residual of one pixel for unit noise, `k + 2 l . m + m^T Q m`.
#[inline(always)]
fn one_pixel<V: Lanes>(noise: &PixelNoise, m: &[V; 6]) -> V {
    let mut sum = V::constant(noise.constant);
    for i in 0..6 {
        let mut inner = V::constant(2.0 * noise.linear[i]);
        for j in 0..6 {
            let q = noise.quadratic[if i <= j { upper(i, j) } else { upper(j, i) }];
            inner = m[j].mul_add(V::constant(q), inner);
        }
        sum = m[i].mul_add(inner, sum);
    }
    sum
}

/// Entry `(i, j)` of `sum_p w T^T Q T` from the moments 1, x, y, x^2, x y, y^2 of the usable pixels, for a
/// symmetric Q.
#[inline(always)]
pub(super) fn noise_entry<V: Lanes>(quadratic: &[f64; ENTRIES], ones: &[V; 6], (i, j): (usize, usize)) -> V {
    let q = |i: usize, j: usize| V::constant(quadratic[if i <= j { upper(i, j) } else { upper(j, i) }]);
    transported_entry(&q, ones, (i, j))
}

/// Entry `(i, j)` of `sum_p w T^T Q T`.
#[inline(always)]
fn transported_entry<V: Lanes>(q: &impl Fn(usize, usize) -> V, ones: &[V; 6], (i, j): (usize, usize)) -> V {
    const POWER: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
    let ((k, c), (l, d)) = ((i / 2, i % 2), (j / 2, j % 2));
    let mut entry = q(c, d) * ones[POWER[k][l]];
    if l > 0 {
        entry = q(c, j).mul_add(ones[k], entry);
    }
    if k > 0 {
        entry = q(i, d).mul_add(ones[l], entry);
    }
    if k > 0 && l > 0 {
        entry = q(i, j).mul_add(ones[0], entry);
    }
    entry
}

/// `sum_p w T^T (l + Q T m)` from the moments 1, x, y, x^2, x y, y^2 of the usable pixels, Q being
/// [`PixelNoise::pull`]: minus the pull of unit noise on the score.
#[inline(always)]
fn pull<V: Lanes>(noise: &PixelNoise, ones: &[V; 6], m: &[V; 6]) -> [V; 6] {
    let q = |i: usize, j: usize| V::constant(noise.pull[i][j]);
    std::array::from_fn(|i| {
        let (k, c) = (i / 2, i % 2);
        let mut sum = V::constant(noise.linear[c]) * ones[k];
        if k > 0 {
            sum = sum + V::constant(noise.linear[i]) * ones[0];
        }
        for j in 0..6 {
            sum = transported_entry(&q, ones, (i, j)).mul_add(m[j], sum);
        }
        sum
    })
}
