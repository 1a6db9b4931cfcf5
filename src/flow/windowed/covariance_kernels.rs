//! The steps of the covariance, each a kernel over one row of a tile.

use super::covariance::{CHANCE, MISFIT_SLACK, NoiseSetting, PIXEL_MISFIT, PIXEL_RESULT, PULL_STEPS};
use super::noise::{PixelNoise, columns, pulled_back};
use super::rows::Plan;
use super::solve::{ENTRIES, MomentRow, normal_matrix, upper};
use super::tile::{JetTile, Planes, TILE_COLUMNS};
use super::window::filter;
use crate::simd::{Kernel, Lanes, SimdReal};

/// Weights of the jet's components in `A^T r`, for one row of pixels; `ROWS` equations a pixel, of which `BLOCK` in each block.
pub(super) struct Weigh<'a, T, const ROWS: usize, const BLOCK: usize> {
    pub setting: &'a NoiseSetting<T>,
    pub jets: &'a JetTile<T>,
    pub motion: &'a [T],
    pub wide: usize,
    pub weights: &'a mut [T],
}

impl<T: SimdReal, const ROWS: usize, const BLOCK: usize> Kernel<T> for Weigh<'_, T, ROWS, BLOCK> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { setting, jets, motion, wide, weights } = self;
        let unknowns = if ROWS == 1 { 2 } else { 6 };
        let mut c = 0;
        while c < wide {
            let m: [V; 6] = std::array::from_fn(|k| V::load(&motion[k * wide + c..]));
            let j = jets.jets::<V>(c, false);
            let scale = V::constant(setting.scale);
            let first = columns::<V, BLOCK>(&j.coefficient);
            let second = columns::<V, BLOCK>(&j.first);
            for a in 0..unknowns {
                let s = if a < 2 { V::constant(1.0) } else { scale };
                let own: [V; 6] = std::array::from_fn(|k| first[a][k] * s);
                let through_jet = pulled_back(&own, &m);
                let mut through_first = own;
                let mut through_second = [V::zero(); 6];
                if ROWS == 12 {
                    through_second = std::array::from_fn(|k| second[a][k] * s);
                    let more = pulled_back(&through_second, &m);
                    through_first = std::array::from_fn(|k| own[k] + more[k]);
                }
                for (q, mix) in setting.pixel.mixing.iter().enumerate() {
                    let [x, y, z] = mix.map(|v| V::constant(v));
                    for k in 0..6 {
                        let mut d = through_jet[k].mul_add(x, through_first[k] * y);
                        if ROWS == 12 {
                            d = through_second[k].mul_add(z, d);
                        }
                        d.store(&mut weights[((q * unknowns + a) * 6 + k) * wide + c..]);
                    }
                }
            }
            c += V::LANES;
        }
    }
}

/// One pass of a smoothing.
pub(super) struct Pass<'a, T> {
    pub source: &'a [T],
    pub centre: usize,
    pub stride: usize,
    pub len: usize,
    pub taps: &'a [[T; 3]],
    pub out: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Pass<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        filter::<V, 1>(self.source, self.centre, self.stride, self.len, self.taps, [self.out]);
    }
}

/// Products `sum h h^T` of one row of the smoothed planes h.
pub(super) struct Outer<'a, T, const UNKNOWNS: usize> {
    pub plan: Plan,
    pub smoothed: &'a [T],
    pub planes: &'a mut Planes<T>,
    pub row: usize,
}

impl<T: SimdReal, const UNKNOWNS: usize> Kernel<T> for Outer<'_, T, UNKNOWNS> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { plan, smoothed, planes, row } = self;
        let width = planes.width;
        let ways = smoothed.len() / (UNKNOWNS * width);
        let mut c = 0;
        while c < width {
            let mut sums = [V::zero(); ENTRIES];
            for q in 0..ways {
                let h: [V; UNKNOWNS] = std::array::from_fn(|a| V::load(&smoothed[(q * UNKNOWNS + a) * width + c..]));
                for i in 0..UNKNOWNS {
                    for j in i..UNKNOWNS {
                        sums[upper(i, j)] = h[i].mul_add(h[j], sums[upper(i, j)]);
                    }
                }
            }
            for i in 0..UNKNOWNS {
                for j in i..UNKNOWNS {
                    if let Some(p) = plan.place(i, j) {
                        let at = planes.at(p, row, c);
                        sums[upper(i, j)].store(&mut planes.data[at..]);
                    }
                }
            }
            c += V::LANES;
        }
    }
}

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
        let (noise, plan) = (&setting.pixel, setting.plan());
        let mut c = 0;
        while c < TILE_COLUMNS {
            let at = |k: usize| V::load(&pixel[k * TILE_COLUMNS + c..]);
            let inverse: [V; ENTRIES] = std::array::from_fn(at);
            let m: [V; 6] = std::array::from_fn(|k| at(ENTRIES + k));
            let (residual, weight) = (at(ENTRIES + 6), at(ENTRIES + 7));
            let ones: [V; 6] = std::array::from_fn(|k| at(ENTRIES + 8 + k));
            let misfit: [V; 6] = std::array::from_fn(|k| at(PIXEL_MISFIT + k));
            let score = normal_matrix::<V, T>(plan, &row, c);
            // B = N^-1 S, then B N^-1.
            let mut b = [[V::zero(); 6]; 6];
            let mut trace = V::zero();
            for i in 0..6 {
                for k in 0..6 {
                    let mut sum = V::zero();
                    for l in 0..6 {
                        sum = symmetric(&inverse, i, l).mul_add(symmetric(&score, l, k), sum);
                    }
                    b[i][k] = sum;
                }
                trace = trace + b[i][i];
            }
            let variance = if let Some(v) = setting.variance {
                V::constant(v)
            } else {
                let expected = one_pixel::<V>(noise, &m) * weight;
                let left = (expected - trace).max(expected * V::constant(0.05));
                let [truncated, energy, known] = std::array::from_fn(|k| at(PIXEL_MISFIT + 6 + k));
                let whole = residual / left;
                let fine = energy / (known * V::constant(setting.detail_gain));
                let chance = V::constant(CHANCE);
                let unexplained = (residual - truncated * V::constant(MISFIT_SLACK)) / (left * chance);
                let enough = (weight * V::constant(0.5)).lt(known);
                V::select(enough, (whole * chance).min(fine.max(unexplained)), whole)
            };
            // The pull acts on the true motion, which is what is left after undoing it.
            let mut shift = [V::zero(); 6];
            for _ in 0..PULL_STEPS {
                let whole: [V; 6] = std::array::from_fn(|k| m[k] + shift[k]);
                let pull = pull::<V>(noise, &ones, &whole);
                let pull: [V; 6] = std::array::from_fn(|k| pull[k].mul_add(variance, misfit[k]));
                for i in 0..6 {
                    let mut sum = V::zero();
                    for k in 0..6 {
                        sum = symmetric(&inverse, i, k).mul_add(pull[k], sum);
                    }
                    shift[i] = sum;
                }
            }
            for i in 0..6 {
                for k in i..6 {
                    let mut sum = V::zero();
                    for l in 0..6 {
                        sum = b[i][l].mul_add(symmetric(&inverse, l, k), sum);
                    }
                    let whole = sum.mul_add(variance, shift[i] * shift[k]);
                    let unit = (if i < 2 { 1.0 } else { setting.scale }) * if k < 2 { 1.0 } else { setting.scale };
                    let target = (PIXEL_RESULT + upper(i, k)) * TILE_COLUMNS + c;
                    (whole * V::constant(unit)).store(&mut pixel[target..]);
                }
            }
            c += V::LANES;
        }
    }
}

/// Adds the adjoint stencil of one row of weights to the planes: `h(p + o) += sum_j L_j(o) d_j(p)`.
pub(super) struct Scatter<'a, T> {
    pub taps: &'a [((isize, isize), [T; 6])],
    pub weights: &'a [T],
    pub wide: usize,
    /// The row and the reach of the stencil.
    pub row: (usize, usize),
    pub scores: &'a mut Planes<T>,
}

impl<T: SimdReal> Kernel<T> for Scatter<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { taps, weights, wide, row: (r, reach), scores } = self;
        let (width, height) = (scores.width, scores.height);
        for (p, d) in weights.chunks_exact(6 * wide).enumerate() {
            for ((x, y), w) in taps {
                // Row r of the weights is row r - reach of the planes.
                let target = r as isize - reach as isize + y;
                if target < 0 || target >= height as isize {
                    continue;
                }
                let w: [V; 6] = std::array::from_fn(|k| V::splat(w[k]));
                let start = scores.at(p, target as usize, 0);
                let row = &mut scores.data[start..start + width];
                let shift = (reach as isize - x) as usize;
                let mut c = 0;
                while c < width {
                    let mut sum = V::load(&row[c..]);
                    for k in 0..6 {
                        sum = V::load(&d[k * wide + shift + c..]).mul_add(w[k], sum);
                    }
                    sum.store(&mut row[c..]);
                    c += V::LANES;
                }
            }
        }
    }
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

/// `sum_p w T^T (l + Q T m)` from the moments 1, x, y, x^2, x y, y^2 of the usable pixels, Q being [`PixelNoise::pull`]: minus the pull of unit noise on the score.
#[inline(always)]
fn pull<V: Lanes>(noise: &PixelNoise, ones: &[V; 6], m: &[V; 6]) -> [V; 6] {
    const POWER: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
    let q = |i: usize, j: usize| V::constant(noise.pull[i][j]);
    std::array::from_fn(|i| {
        let (k, c) = (i / 2, i % 2);
        let mut sum = V::constant(noise.linear[c]) * ones[k];
        if k > 0 {
            sum = sum + V::constant(noise.linear[i]) * ones[0];
        }
        for j in 0..6 {
            let (l, d) = (j / 2, j % 2);
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
            sum = entry.mul_add(m[j], sum);
        }
        sum
    })
}
