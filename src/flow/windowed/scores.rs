//! What the noise of each sample does to the right-hand sides around it: the matrix S of the covariance.
//!
//! Stencils and smoothing spread the noise of one sample over many pixels, so `s2 N^-1` would be far off.
//! Instead `sum_p w T_p^T A_p^T r_p` is turned round, to run over the noisy samples q: `sum_q w_q T_q^T h(q)
//! e(q)` with `h = sum_j L_j^T d_j`, `d_j(p)` the weight of the jet's component j in `A_p^T r_p` and `L_j^T`
//! the adjoint of the stencil. Then `S = sum_q w_q^2 T_q^T h h^T T_q`: one more pass of moments.
//!
//! Smoothing by a Gaussian of variance t2 comes in between. The product of the window, of variance w2, and of
//! the kernel about the sample q is the Gaussian of variance `w2 + t2` at q times a kernel of variance `a t2`
//! about `a q`, `a = w2 / (w2 + t2)`. So h is smoothed by `a t2` instead of t2, samples count at the place `a
//! q`, and the squared weights are those of a Gaussian of variance `a w2`, times `a` for each axis. The
//! stencil's few pixels are taken to be one place.

use super::combine::Combination;
use super::covariance::write_covariances;
use super::equations::{columns, pulled_back};
use super::estimate::Strip;
use super::moments::{Moments, Window};
use super::noise::{PixelNoise, smoothing_weights};
use super::options::WindowedOptions;
use super::plan::Plan;
use super::tile::{GROUP_ROWS, Grid, JetTile, Planes, Source, TILE_COLUMNS, padded};
use crate::flow::moment_filter::filter;
use crate::flow::options::EstimatorOptions;
use crate::flow::symmetric::{ENTRIES, upper};
use crate::jet::JetStencil;
use crate::parallel;
use crate::simd::{Kernel, Lanes, SimdReal, dispatch};
use std::ops::Range;

/// Constants of the covariance.
pub(super) struct CovarianceSetting<T> {
    noise: PixelNoise,
    /// The stencil: offset and weights of each of its samples.
    taps: Vec<((isize, isize), [T; 6])>,
    /// Largest offset of the stencil, px.
    reach: usize,
    /// Kernel of the smoothing as the window sees it, or of radius 0.
    smoothing: Window<T>,
    /// Squared weights of the noisy samples.
    squared: Window<T>,
    plan: Plan,
    /// Planes of one covariance: 21, or 42 with its systematic part.
    planes: usize,
}

impl<T: SimdReal> CovarianceSetting<T> {
    /// For these options and their stencil, and frames that hold whole numbers or not.
    pub fn new(
        (options, stencil): (&WindowedOptions, &JetStencil),
        (common, rounded): (&EstimatorOptions, bool),
        combination: Combination,
    ) -> Self {
        let smooth = options.presmooth;
        let reach = stencil.reach();
        // The window leaves of the kernel only what it weighs alike.
        let narrowed = smooth.map(|s| s * options.sigma / options.sigma.hypot(s));
        let variances = (common.noise.map(|n| n * n), if rounded { 1.0 / 12.0 } else { 0.0 });
        let taps = stencil.offsets().iter().zip(stencil.weights());
        Self {
            noise: PixelNoise::new((options, stencil, combination), variances),
            taps: taps.map(|(&(x, y), w)| ((x as isize, y as isize), w.map(T::from_f64))).collect(),
            reach: reach.left.max(reach.right).max(reach.up).max(reach.down),
            smoothing: Window::new(&smoothing_weights(narrowed), 1.0),
            squared: Window::squared(options.sigma, options.radius(), smooth.unwrap_or(0.0)),
            plan: Plan::outer(Plan::of_rows(options.rows.count()).columns),
            planes: if common.systematic { 2 * ENTRIES } else { ENTRIES },
        }
    }

    /// How far beyond a site estimates of the motion are used, px.
    pub fn margin(&self) -> usize {
        self.squared.radius() + self.smoothing.radius() + self.reach
    }

    /// Upper triangles at the rows and columns of the second and third of the strips, in px and frames, and
    /// after them those of the systematic part. The first strip holds the margin around them too.
    pub fn covariance(&self, source: &Source<'_, T>, strips: [&Strip<T>; 3]) -> Grid<T> {
        let Grid { rows, columns, .. } = &strips[1].grid;
        let mut grid = Grid::new(rows.clone(), columns.clone(), self.planes);
        parallel::for_each(grid.tasks(), |(rows, out)| {
            let (scratch, columns) = (&mut Scratch::default(), columns.clone());
            Task { setting: self, source, strips, scratch, rows, columns, out }.run();
        });
        grid
    }
}

/// Buffers of one task.
#[derive(Default)]
struct Scratch<T> {
    jets: JetTile<T>,
    /// Motion around the tile, six rows.
    motion: Vec<T>,
    /// Weights of the jet's components in one row: `[way][unknown][component]`.
    weights: Vec<T>,
    /// The planes h, before smoothing: `way * columns + column`.
    scores: Planes<T>,
    /// Products of the smoothed h.
    planes: Planes<T>,
    row: Vec<T>,
    smoothed: Vec<T>,
    sums: Moments<T>,
    pixel: Vec<T>,
}

/// The covariance of a band of rows.
struct Task<'a, T> {
    setting: &'a CovarianceSetting<T>,
    source: &'a Source<'a, T>,
    strips: [&'a Strip<T>; 3],
    scratch: &'a mut Scratch<T>,
    rows: &'a [usize],
    columns: Range<usize>,
    out: &'a mut [T],
}

impl<T: SimdReal> Task<'_, T> {
    fn run(mut self) {
        let (setting, level) = (self.setting, self.source.level);
        let (top, bottom) = (self.rows[0], self.rows[self.rows.len() - 1]);
        let radius = setting.squared.radius();
        for left in self.columns.clone().step_by(TILE_COLUMNS) {
            self.scores(left, (top, bottom));
            self.products(bottom - top + 1 + 2 * radius);
            let count = (self.columns.end - left).min(TILE_COLUMNS);
            for (group, rows) in self.rows.chunks(GROUP_ROWS).enumerate() {
                let centres: Vec<usize> = rows.iter().map(|y| y - top + radius).collect();
                let Scratch { sums, planes, pixel, .. } = &mut *self.scratch;
                let plan = setting.plan;
                sums.sum(level, &setting.squared, planes, (plan, plan.normal()), &centres);
                for (g, y) in rows.iter().enumerate() {
                    let j = group * GROUP_ROWS + g;
                    let (width, size) = (self.columns.len(), setting.planes * self.columns.len());
                    let out = (&mut self.out[j * size..(j + 1) * size], width, left - self.columns.start, count);
                    write_covariances(pixel, level, &setting.noise, (plan, sums, g), (self.strips, left, *y), out);
                }
            }
        }
    }

    /// The planes h of a tile, before smoothing.
    fn scores(&mut self, left: usize, (top, bottom): (usize, usize)) {
        let Self { setting, source, strips: [strip, ..], scratch, .. } = self;
        let Scratch { jets, motion, weights, scores, .. } = &mut **scratch;
        let (reach, spread) = (setting.reach, setting.squared.radius() + setting.smoothing.radius());
        let count = setting.noise.ways.len() * setting.plan.columns;
        let (width, height) = (padded(TILE_COLUMNS + 2 * spread), bottom - top + 1 + 2 * spread);
        scores.resize(count, width, height);
        scores.data.fill(T::default());
        // Pixels whose stencils reach into that rectangle.
        let margin = (reach + spread) as isize;
        let corner = (left as isize - margin, top as isize - margin);
        let (wide, high) = (padded(width + 2 * reach), height + 2 * reach);
        jets.load(source, corner, wide, high);
        motion.resize(6 * wide, T::default());
        weights.resize(count * 6 * wide, T::default());
        let noise = &setting.noise;
        for r in 0..high {
            jets.row(source, r);
            strip.motion_row(corner.0, corner.1 + r as isize, motion);
            let (motion, jets, weights) = (&motion[..], &*jets, &mut weights[..]);
            match source.rows {
                1 => dispatch(source.level, Weigh::<T, 1> { noise, jets, motion, wide, weights }),
                3 => dispatch(source.level, Weigh::<T, 3> { noise, jets, motion, wide, weights }),
                6 => dispatch(source.level, Weigh::<T, 6> { noise, jets, motion, wide, weights }),
                _ => dispatch(source.level, Weigh::<T, 12> { noise, jets, motion, wide, weights }),
            }
            dispatch(source.level, Scatter { taps: &setting.taps, weights, wide, row: (r, reach), scores });
        }
    }

    /// Smooths the planes h and multiplies them, over `height` rows.
    fn products(&mut self, height: usize) {
        let Self { setting, source, scratch, .. } = self;
        let (level, plan, taps) = (source.level, setting.plan, &setting.smoothing.taps[..]);
        let Scratch { scores, planes, row, smoothed, .. } = &mut **scratch;
        let spread = setting.smoothing.radius();
        let width = padded(TILE_COLUMNS + 2 * setting.squared.radius());
        planes.resize(plan.normal(), width, height);
        row.resize(scores.width.max(padded(width + 2 * spread)), T::default());
        smoothed.resize(setting.noise.ways.len() * plan.columns * width, T::default());
        for r in 0..height {
            for (p, target) in smoothed.chunks_exact_mut(width).enumerate() {
                let (source, stride) = (scores.plane(p), scores.width);
                let centre = (r + spread) * stride;
                dispatch(level, Pass { source, centre, stride, len: stride, taps, out: row });
                dispatch(level, Pass { source: row, centre: spread, stride: 1, len: width, taps, out: target });
            }
            match plan.columns {
                2 => dispatch(level, Outer::<T, 2> { smoothed, planes, row: r }),
                _ => dispatch(level, Outer::<T, 6> { smoothed, planes, row: r }),
            }
        }
    }
}

/// Weights of the jet's components in `A^T r`, for one row of pixels; `ROWS` equations a pixel.
struct Weigh<'a, T, const ROWS: usize> {
    noise: &'a PixelNoise,
    jets: &'a JetTile<T>,
    motion: &'a [T],
    wide: usize,
    weights: &'a mut [T],
}

impl<T: SimdReal, const ROWS: usize> Kernel<T> for Weigh<'_, T, ROWS> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { noise, jets, motion, wide, weights } = self;
        let unknowns = Plan::of_rows(ROWS).columns;
        let mut c = 0;
        while c < wide {
            let m: [V; 6] = std::array::from_fn(|k| V::load(&motion[k * wide + c..]));
            let (jets, _) = jets.jets::<V>(c, false);
            let first = columns::<V, ROWS>(&jets.coefficient);
            let second = columns::<V, ROWS>(&jets.first);
            for a in 0..unknowns {
                let scale = V::constant(if a < 2 { 1.0 } else { noise.scale });
                let own = first[a].map(|value| value * scale);
                let through_jet = pulled_back(&own, &m);
                let (mut through_first, mut through_second) = (own, [V::zero(); 6]);
                if ROWS == 12 {
                    through_second = second[a].map(|value| value * scale);
                    let more = pulled_back(&through_second, &m);
                    through_first = std::array::from_fn(|k| own[k] + more[k]);
                }
                for (q, way) in noise.ways.iter().enumerate() {
                    let [x, y, z] = way.map(|v| V::constant(v));
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

/// Adds the adjoint stencil of one row of weights to the planes: `h(p + o) += sum_j L_j(o) d_j(p)`.
struct Scatter<'a, T> {
    taps: &'a [((isize, isize), [T; 6])],
    weights: &'a [T],
    wide: usize,
    /// The row and the reach of the stencil.
    row: (usize, usize),
    scores: &'a mut Planes<T>,
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

/// One pass of a smoothing.
struct Pass<'a, T> {
    source: &'a [T],
    centre: usize,
    stride: usize,
    len: usize,
    taps: &'a [[T; 3]],
    out: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Pass<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        filter::<V, 1>(self.source, self.centre, self.stride, self.len, self.taps, [self.out]);
    }
}

/// Products `sum h h^T` of one row of the smoothed planes h.
struct Outer<'a, T, const COLUMNS: usize> {
    smoothed: &'a [T],
    planes: &'a mut Planes<T>,
    row: usize,
}

impl<T: SimdReal, const COLUMNS: usize> Kernel<T> for Outer<'_, T, COLUMNS> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { smoothed, planes, row } = self;
        let (width, plan) = (planes.width, Plan::outer(COLUMNS));
        let mut c = 0;
        while c < width {
            let mut sums = [V::zero(); ENTRIES];
            for way in smoothed.chunks_exact(COLUMNS * width) {
                let h: [V; COLUMNS] = std::array::from_fn(|a| V::load(&way[a * width + c..]));
                for i in 0..COLUMNS {
                    for j in i..COLUMNS {
                        sums[upper(i, j)] = h[i].mul_add(h[j], sums[upper(i, j)]);
                    }
                }
            }
            for i in 0..COLUMNS {
                for j in i..COLUMNS {
                    let Some(place) = plan.place(i, j) else { continue };
                    let at = planes.at(place, row, c);
                    sums[upper(i, j)].store(&mut planes.data[at..]);
                }
            }
            c += V::LANES;
        }
    }
}
