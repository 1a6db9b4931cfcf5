//! Covariance of the windowed estimate.
//!
//! To first order the error of `m = N^-1 sum_p w T_p^T A_p^T b_p` is `N^-1 sum_p w T_p^T A_p^T r_p`, `r_p` what noise leaves in the pixel's equations. Stencils and smoothing
//! spread the noise of one sample over many pixels, so `s2 N^-1` would be far off. Instead the sum is turned round, to run over the noisy samples q:
//! `sum_q w_q T_q^T h(q) e(q)` with `h = sum_j L_j^T d_j`, `d_j(p)` the weight of the jet's component j in `A_p^T r_p` and `L_j^T` the adjoint of the smoothed stencil
//! (window and transport hardly change within its reach). Then `Cov = s2 N^-1 S N^-1`, `S = sum_q w_q^2 T_q^T h h^T T_q`: one more pass of moments.
//!
//! The same noise in the coefficients draws the estimate towards zero, by `N^-1 s2 (sum_p w T^T C T) m` with C the noise's own `E[dA^T dA]`. That pull is not subtracted; its
//! outer product is added, so that the covariance is that of the whole error. Unless the noise is given, its variance is the
//! residual's sum of squares over its expectation `c0 sum w - tr(N^-1 S)`, which makes it unbiased for white noise, rounding included; what discretisation
//! leaves in the residual widens it.

use super::estimate::Strip;
use super::noise::{PixelNoise, columns, pulled_back};
use super::rows::Plan;
use super::solve::{ENTRIES, MomentRow, normal_matrix, upper};
use super::tile::{GROUP_ROWS, JetTile, Moments, Planes, Source, TILE_COLUMNS, padded};
use super::window::{Window, filter};
use crate::jet::JetStencil;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use rayon::prelude::*;
use std::ops::Range;

/// Rows of one parallel task.
const TASK_ROWS: usize = 64;

/// What the covariance needs beside the estimates.
pub(super) struct NoiseSetting<T> {
    /// Second moments of the noise.
    pub pixel: PixelNoise,
    /// The stencil: offset and weights of each of its samples.
    pub taps: Vec<((isize, isize), [T; 6])>,
    /// Largest offset of the stencil, px.
    pub reach: usize,
    /// Kernel of the smoothing, or of radius 0.
    pub smoothing: Window<T>,
    /// The window of the normal equations, and its square.
    pub window: Window<T>,
    /// Squared weights.
    pub squared: Window<T>,
    /// 1 / sigma of the window.
    pub scale: f64,
    /// Equations a pixel.
    pub rows: usize,
    /// Variance of the pixel noise; `None`: from the residual.
    pub variance: Option<f64>,
    /// Instruction set.
    pub level: Level,
}

impl<T: SimdReal> NoiseSetting<T> {
    /// Offsets and weights of a stencil in working precision.
    pub fn taps(stencil: &JetStencil) -> Vec<((isize, isize), [T; 6])> {
        let pairs = stencil.offsets().iter().zip(stencil.weights());
        pairs.map(|(&(x, y), w)| ((x as isize, y as isize), w.map(T::from_f64))).collect()
    }

    /// How far beyond a site estimates of the motion are used, px.
    pub fn margin(&self) -> usize {
        self.squared.radius() + self.smoothing.radius() + self.reach
    }

    /// The upper triangle at the rows `rows` and columns `columns` of an image, which the strip holds with the margin around them
    /// (where the frame has one): 21 planes of `rows.len() * columns.len()`, in px and frames.
    pub fn covariance(
        &self,
        source: &Source<'_, T>,
        strip: &Strip<T>,
        rows: &[usize],
        columns: &Range<usize>,
    ) -> Vec<T> {
        let (width, n) = (columns.len(), columns.len() * rows.len());
        let mut planes = vec![T::nan(); ENTRIES * n];
        if n == 0 {
            return planes;
        }
        let spacing = rows.get(1).map_or(1, |second| second - rows[0]);
        let task = (TASK_ROWS / spacing).max(1);
        let mut bands: Vec<(&[usize], Vec<&mut [T]>)> = rows.chunks(task).map(|r| (r, Vec::new())).collect();
        for plane in planes.chunks_mut(n) {
            bands.iter_mut().zip(plane.chunks_mut(task * width)).for_each(|(b, p)| b.1.push(p));
        }
        bands.into_par_iter().for_each_init(Scratch::new, |scratch, (rows, out)| {
            let columns = columns.clone();
            match self.rows {
                1 => dispatch(
                    self.level,
                    BandKernel::<T, 1, 1> { setting: self, source, strip, scratch, rows, columns, out },
                ),
                3 => dispatch(
                    self.level,
                    BandKernel::<T, 3, 3> { setting: self, source, strip, scratch, rows, columns, out },
                ),
                6 => dispatch(
                    self.level,
                    BandKernel::<T, 6, 6> { setting: self, source, strip, scratch, rows, columns, out },
                ),
                _ => dispatch(
                    self.level,
                    BandKernel::<T, 12, 6> { setting: self, source, strip, scratch, rows, columns, out },
                ),
            }
        });
        planes
    }
}

/// Buffers of one thread.
struct Scratch<T> {
    jets: JetTile<T>,
    /// Motion around the tile, six rows.
    motion: Vec<T>,
    /// Weights of the jet's components in one row: `[way][unknown][component]`.
    weights: Vec<T>,
    /// The planes h, before smoothing.
    scores: Planes<T>,
    /// Products of the smoothed h.
    planes: Planes<T>,
    row: Vec<T>,
    smoothed: Vec<T>,
    sums: Moments<T>,
    usable: Planes<T>,
    usable_sums: Moments<T>,
    /// Inverse, motion, residual, weight, moments of the usable pixels at one row of the tile; then the result.
    pixel: Vec<T>,
}

impl<T: SimdReal> Scratch<T> {
    fn new() -> Self {
        Self {
            jets: JetTile::new(),
            motion: Vec::new(),
            weights: Vec::new(),
            scores: Planes::new(),
            planes: Planes::new(),
            row: Vec::new(),
            smoothed: Vec::new(),
            sums: Moments::new(),
            usable: Planes::new(),
            usable_sums: Moments::new(),
            pixel: Vec::new(),
        }
    }
}

/// Fixed-point steps towards the true motion in the pull of the noise.
const PULL_STEPS: usize = 3;
/// Rows of `Scratch::pixel`.
const PIXEL: usize = 2 * ENTRIES + 6 + 2 + 6;

/// `ROWS` equations a pixel, of which `BLOCK` in each block.
struct BandKernel<'a, 'b, T, const ROWS: usize, const BLOCK: usize> {
    setting: &'a NoiseSetting<T>,
    source: &'a Source<'a, T>,
    strip: &'a Strip<T>,
    scratch: &'a mut Scratch<T>,
    rows: &'a [usize],
    columns: Range<usize>,
    out: Vec<&'b mut [T]>,
}

impl<T: SimdReal, const ROWS: usize, const BLOCK: usize> Kernel<T> for BandKernel<'_, '_, T, ROWS, BLOCK> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(mut self) {
        let (Some(&top), Some(&bottom)) = (self.rows.first(), self.rows.last()) else { return };
        let radius = self.setting.squared.radius();
        let plan = Self::plan();
        self.scratch.pixel.resize(PIXEL * TILE_COLUMNS, T::default());
        for left in self.columns.clone().step_by(TILE_COLUMNS) {
            self.scores::<V>(left, (top, bottom));
            self.products::<V>((top, bottom));
            if !self.source.support.is_whole() {
                self.usable(left, (top, bottom));
            }
            for (group, rows) in self.rows.chunks(GROUP_ROWS).enumerate() {
                let mut centres = [0; GROUP_ROWS];
                for (centre, y) in centres.iter_mut().zip(rows) {
                    *centre = y - top + radius;
                }
                let centres = &mut centres[..rows.len()];
                let Scratch { sums, planes, usable, usable_sums, .. } = &mut *self.scratch;
                for p in 0..plan.planes() {
                    sums.sum::<V>(&self.setting.squared, planes, (p, plan.order(p), plan.base(p)), centres);
                }
                if !self.source.support.is_whole() {
                    let more = self.setting.window.radius() - radius;
                    centres.iter_mut().for_each(|c| *c += more);
                    usable_sums.sum::<V>(&self.setting.window, usable, (0, 2, 0), centres);
                }
                for g in 0..rows.len() {
                    self.finish_row::<V>(group * GROUP_ROWS + g, g, left);
                }
            }
        }
    }
}

impl<T: SimdReal, const ROWS: usize, const BLOCK: usize> BandKernel<'_, '_, T, ROWS, BLOCK> {
    /// Unknowns that have a column of their own in the equations; with row 1 alone the others act by transport only.
    const UNKNOWNS: usize = if ROWS == 1 { 2 } else { 6 };

    const fn plan() -> Plan {
        if ROWS == 1 { Plan::flow() } else { Plan::outer() }
    }

    /// The planes h of a tile, before smoothing: `scores` holds `way * UNKNOWNS + unknown`.
    #[inline(always)]
    fn scores<V: Lanes<Scalar = T>>(&mut self, left: usize, (top, bottom): (usize, usize)) {
        let Self { setting, source, strip, scratch, .. } = self;
        let Scratch { jets, motion, weights, scores, .. } = &mut **scratch;
        let (reach, spread) = (setting.reach, setting.squared.radius() + setting.smoothing.radius());
        let ways = setting.pixel.mixing.len();
        let (width, height) = (padded(TILE_COLUMNS + 2 * spread), bottom - top + 1 + 2 * spread);
        scores.resize(ways * Self::UNKNOWNS, width, height);
        scores.data.fill(T::default());
        // Pixels whose stencils reach into that rectangle.
        let margin = (reach + spread) as isize;
        let corner = (left as isize - margin, top as isize - margin);
        let (wide, high) = (padded(width + 2 * reach), height + 2 * reach);
        jets.load(source, corner, wide, high);
        motion.resize(6 * wide, T::default());
        weights.resize(ways * Self::UNKNOWNS * 6 * wide, T::default());
        for r in 0..high {
            jets.row::<V>(source, r);
            strip.motion_row(corner.0, corner.1 + r as isize, setting.scale, motion);
            let mut c = 0;
            while c < wide {
                let m: [V; 6] = std::array::from_fn(|k| V::load(&motion[k * wide + c..]));
                let j = jets.jets::<V>(c, false);
                let scale = V::constant(setting.scale);
                let first = columns::<V, BLOCK>(&j.coefficient);
                let second = columns::<V, BLOCK>(&j.first);
                for a in 0..Self::UNKNOWNS {
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
                            d.store(&mut weights[((q * Self::UNKNOWNS + a) * 6 + k) * wide + c..]);
                        }
                    }
                }
                c += V::LANES;
            }
            scatter::<V>(&setting.taps, weights, wide, (r, reach), scores);
        }
    }

    /// Smooths the planes h and multiplies them.
    #[inline(always)]
    fn products<V: Lanes<Scalar = T>>(&mut self, (top, bottom): (usize, usize)) {
        let plan = Self::plan();
        let Self { setting, scratch, .. } = self;
        let Scratch { scores, planes, row, smoothed, .. } = &mut **scratch;
        let (radius, spread) = (setting.squared.radius(), setting.smoothing.radius());
        let ways = setting.pixel.mixing.len();
        let (width, height) = (padded(TILE_COLUMNS + 2 * radius), bottom - top + 1 + 2 * radius);
        planes.resize(plan.planes(), width, height);
        row.resize(scores.width.max(padded(width + 2 * spread)), T::default());
        smoothed.resize(ways * Self::UNKNOWNS * width, T::default());
        for r in 0..height {
            for (p, target) in smoothed.chunks_exact_mut(width).enumerate() {
                if spread == 0 {
                    let at = scores.at(p, r, 0);
                    target.copy_from_slice(&scores.data[at..at + width]);
                } else {
                    let taps = &setting.smoothing.taps;
                    let centre = (r + spread) * scores.width;
                    filter::<V, 1>(scores.plane(p), centre, scores.width, scores.width, taps, [row]);
                    filter::<V, 1>(row, spread, 1, width, taps, [target]);
                }
            }
            let mut c = 0;
            while c < width {
                let mut sums = [V::zero(); ENTRIES];
                for q in 0..ways {
                    let h: [V; 6] = std::array::from_fn(|a| {
                        if a < Self::UNKNOWNS {
                            V::load(&smoothed[(q * Self::UNKNOWNS + a) * width + c..])
                        } else {
                            V::zero()
                        }
                    });
                    for i in 0..Self::UNKNOWNS {
                        for j in i..Self::UNKNOWNS {
                            sums[upper(i, j)] = h[i].mul_add(h[j], sums[upper(i, j)]);
                        }
                    }
                }
                for i in 0..Self::UNKNOWNS {
                    for j in i..Self::UNKNOWNS {
                        if let Some(p) = plan.place(i, j) {
                            let at = planes.at(p, r, c);
                            sums[upper(i, j)].store(&mut planes.data[at..]);
                        }
                    }
                }
                c += V::LANES;
            }
        }
    }

    /// The plane of usable pixels of a tile, with the margin of the window.
    fn usable(&mut self, left: usize, (top, bottom): (usize, usize)) {
        let radius = self.setting.window.radius();
        let plane = &mut self.scratch.usable;
        plane.resize(1, padded(TILE_COLUMNS + 2 * radius), bottom - top + 1 + 2 * radius);
        let (x, y) = (left as isize - radius as isize, top as isize - radius as isize);
        for (r, row) in plane.data.chunks_exact_mut(plane.width).enumerate() {
            self.source.support.weights(x, y + r as isize, row);
        }
    }

    /// Covariance of row `j` of the band, whose moments are row `g` of the group, at the columns of the tile that begins at `left`.
    #[inline(always)]
    fn finish_row<V: Lanes<Scalar = T>>(&mut self, j: usize, g: usize, left: usize) {
        self.gather(j, g, left);
        let Self { setting, scratch, .. } = self;
        let Scratch { sums, pixel, .. } = &mut **scratch;
        let row = MomentRow { data: &sums.data, first: g * TILE_COLUMNS, stride: GROUP_ROWS * TILE_COLUMNS };
        let noise = &setting.pixel;
        let mut c = 0;
        while c < TILE_COLUMNS {
            let at = |k: usize| V::load(&pixel[k * TILE_COLUMNS + c..]);
            let inverse: [V; ENTRIES] = std::array::from_fn(at);
            let m: [V; 6] = std::array::from_fn(|k| at(ENTRIES + k));
            let (residual, weight) = (at(ENTRIES + 6), at(ENTRIES + 7));
            let ones: [V; 6] = std::array::from_fn(|k| at(ENTRIES + 8 + k));
            let score = normal_matrix::<V, T>(Self::plan(), &row, c);
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
            let variance = match setting.variance {
                Some(v) => V::constant(v),
                None => {
                    let expected = one_pixel::<V>(noise, &m) * weight;
                    let left = (expected - trace).max(expected * V::constant(0.05));
                    residual / left
                }
            };
            // The pull acts on the true motion, which is what is left after undoing it.
            let mut shift = [V::zero(); 6];
            for _ in 0..PULL_STEPS {
                let whole: [V; 6] = std::array::from_fn(|k| m[k] + shift[k]);
                let pull = pull::<V>(noise, &ones, &whole);
                for i in 0..6 {
                    let mut sum = V::zero();
                    for k in 0..6 {
                        sum = symmetric(&inverse, i, k).mul_add(pull[k], sum);
                    }
                    shift[i] = sum * variance;
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
                    let target = (ENTRIES + 14 + upper(i, k)) * TILE_COLUMNS + c;
                    (whole * V::constant(unit)).store(&mut pixel[target..]);
                }
            }
            c += V::LANES;
        }
        let (width, count) = (self.columns.len(), (self.columns.end - left).min(TILE_COLUMNS));
        let from = j * width + left - self.columns.start;
        for (k, plane) in self.out.iter_mut().enumerate() {
            let source = (ENTRIES + 14 + k) * TILE_COLUMNS;
            plane[from..from + count].copy_from_slice(&self.scratch.pixel[source..source + count]);
        }
    }

    /// Copies what the strip and the window know of row `j` of the band to `Scratch::pixel`.
    #[inline(never)]
    fn gather(&mut self, j: usize, g: usize, left: usize) {
        let Self { setting, source, strip, scratch, rows, columns, .. } = self;
        let y = rows[j];
        let count = (columns.end - left).min(TILE_COLUMNS);
        let n = strip.rows.len() * strip.columns.len();
        let from = (y - strip.rows[0]) * strip.columns.len() + left - strip.columns.start;
        let planes =
            strip.inverse.chunks(n).chain(strip.motion.chunks(n)).chain([&strip.residual[..], &strip.weight[..]]);
        for (row, plane) in scratch.pixel.chunks_exact_mut(TILE_COLUMNS).zip(planes) {
            row[..count].copy_from_slice(&plane[from..from + count]);
        }
        let (inside_x, inside_y) = source.support.inside();
        let v = setting.window.partial(y, inside_y.start, inside_y.end);
        for c in 0..count {
            let ones = if source.support.is_whole() {
                let h = setting.window.partial(left + c, inside_x.start, inside_x.end);
                [h[0] * v[0], h[1] * v[0], h[0] * v[1], h[2] * v[0], h[1] * v[1], h[0] * v[2]].map(T::from_f64)
            } else {
                std::array::from_fn(|k| scratch.usable_sums.data[(k * GROUP_ROWS + g) * TILE_COLUMNS + c])
            };
            for (k, one) in ones.into_iter().enumerate() {
                scratch.pixel[(ENTRIES + 8 + k) * TILE_COLUMNS + c] = one;
            }
        }
    }
}

/// Adds the adjoint stencil of one row of weights to the planes: `h(p + o) += sum_j L_j(o) d_j(p)`.
#[inline(always)]
fn scatter<V: Lanes>(
    taps: &[((isize, isize), [V::Scalar; 6])],
    weights: &[V::Scalar],
    wide: usize,
    (r, reach): (usize, usize),
    scores: &mut Planes<V::Scalar>,
) where
    V::Scalar: SimdReal,
{
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

/// `sum_p w T^T (l + Q T m)` from the moments 1, x, y, x^2, x y, y^2 of the usable pixels: minus the pull of unit noise on the score.
#[inline(always)]
fn pull<V: Lanes>(noise: &PixelNoise, ones: &[V; 6], m: &[V; 6]) -> [V; 6] {
    const POWER: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
    let q = |i: usize, j: usize| V::constant(noise.quadratic[if i <= j { upper(i, j) } else { upper(j, i) }]);
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
