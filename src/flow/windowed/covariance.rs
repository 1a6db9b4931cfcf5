//! Covariance of the windowed estimate: sums over windows, tile by tile.
//!
//! To first order the error of `m = N^-1 sum_p w T_p^T A_p^T b_p` is `N^-1 sum_p w T_p^T A_p^T r_p`, `r_p`
//! what noise leaves in the pixel's equations. Stencils and smoothing spread the noise of one sample over
//! many pixels, so `s2 N^-1` would be far off. Instead the sum is turned round, to run over the noisy samples
//! q: `sum_q w_q T_q^T h(q) e(q)` with `h = sum_j L_j^T d_j`, `d_j(p)` the weight of the jet's component j in
//! `A_p^T r_p` and `L_j^T` the adjoint of the stencil. Then `Cov = s2 N^-1 S N^-1`, `S = sum_q w_q^2 T_q^T h
//! h^T T_q`: one more pass of moments.
//!
//! Smoothing by a Gaussian of variance t2 comes in between. The product of the window, of variance w2, and of
//! the kernel about the sample q is the Gaussian of variance `w2 + t2` at q times a kernel of variance `a t2`
//! about `a q`, `a = w2 / (w2 + t2)`. So h is smoothed by `a t2` instead of t2, samples count at the place `a
//! q`, and the squared weights are those of a Gaussian of variance `a w2`, times `a` for each axis. The
//! stencil's few pixels are taken to be one place.
//!
//! Three biases have a known direction: noise in the coefficients towards
//! zero, by `N^-1 s2 (sum_p w T^T C T) m` with C the noise's own `E[dA^T dA]`; truncation
//! ([`super::truncation`]); and flow that is not affine in the window ([`super::bias_planes`]). None is
//! subtracted; the outer product of the first two's sum is added and that of the third, so that the
//! covariance is that of the whole error.
//!
//! Unless the noise is given, its variance is read from the highest frequencies of the frames
//! ([`super::high_frequencies`]), where motion and misfit are weak. The residual gives another, its sum of
//! squares over its expectation `c0 sum w - tr(N^-1 S)`, which misfit can only raise: so the variance is
//! never more than what chance allows beyond that, and where the residual is that much larger than noise and
//! truncation explain, at motion boundaries or changes of lighting, it inflates the covariance.

use super::bias_planes::{self, Ring};
use super::covariance_kernels::{Outer, Pass, Scatter, Weigh};
use super::estimate::Strip;
use super::high_frequencies::HighFrequencies;
use super::noise_dominated;
use super::noise_setting::NoiseSetting;
use super::sandwich::{PIXEL, PIXEL_MISFIT, PIXEL_NOISE, PIXEL_RESULT, Sandwich};
use super::solve::MomentRow;
use super::tile::{GROUP_ROWS, JetTile, Moments, Planes, Source, TILE_COLUMNS, padded};
use crate::ablation::keeps;
use crate::flow::symmetric::ENTRIES;
use crate::simd::{SimdReal, dispatch};
use rayon::prelude::*;
use std::ops::Range;

/// Rows of one parallel task.
const TASK_ROWS: usize = 64;

impl<T: SimdReal> NoiseSetting<T> {
    /// The upper triangle at the rows `rows` and columns `columns` of an image, which the strip holds with
    /// the margin around them (where the frame has one): 21 planes of `rows.len() * columns.len()`, in px and
    /// frames; with `parts` 21 more, what is left of it without the noise.
    pub fn covariance(
        &self,
        (source, detail): (&Source<'_, T>, Option<&HighFrequencies<T>>),
        strip: &Strip<T>,
        rows: &[usize],
        columns: &Range<usize>,
    ) -> Vec<T> {
        let (width, n) = (columns.len(), columns.len() * rows.len());
        let mut planes = vec![T::nan(); if self.parts { 2 * ENTRIES } else { ENTRIES } * n];
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
            BandTask { setting: self, source, detail, strip, scratch, rows, columns, out }.run();
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
    ring: Ring<T>,
    /// Planes of the misfit, and two of the detail.
    misfit: Planes<T>,
    misfit_sums: Moments<T>,
    /// Inverse, motion, residual, weight, moments of the usable pixels at one row of the tile; then the
    /// result.
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
            ring: Ring::new(),
            misfit: Planes::new(),
            misfit_sums: Moments::new(),
            pixel: Vec::new(),
        }
    }
}

/// The covariance of a band of rows.
struct BandTask<'a, 'b, T> {
    setting: &'a NoiseSetting<T>,
    source: &'a Source<'a, T>,
    detail: Option<&'a HighFrequencies<T>>,
    strip: &'a Strip<T>,
    scratch: &'a mut Scratch<T>,
    rows: &'a [usize],
    columns: Range<usize>,
    out: Vec<&'b mut [T]>,
}

impl<T: SimdReal> BandTask<'_, '_, T> {
    fn run(mut self) {
        let level = self.setting.level;
        let (Some(&top), Some(&bottom)) = (self.rows.first(), self.rows.last()) else { return };
        let radius = self.setting.squared.radius();
        let plan = self.setting.plan();
        self.scratch.pixel.resize(PIXEL * TILE_COLUMNS, T::default());
        for left in self.columns.clone().step_by(TILE_COLUMNS) {
            self.scores(left, (top, bottom));
            self.products((top, bottom));
            self.misfit(left, (top, bottom));
            if !self.source.support.is_whole() {
                self.usable(left, (top, bottom));
            }
            for (group, rows) in self.rows.chunks(GROUP_ROWS).enumerate() {
                let mut centres = [0; GROUP_ROWS];
                for (centre, y) in centres.iter_mut().zip(rows) {
                    *centre = y - top + radius;
                }
                let centres = &mut centres[..rows.len()];
                let Scratch { sums, planes, usable, usable_sums, misfit, misfit_sums, .. } = &mut *self.scratch;
                for p in 0..plan.planes() {
                    sums.sum(level, &self.setting.squared, planes, (p, plan.order(p), plan.base(p)), centres);
                }
                let (window, more) = (&self.setting.window, self.setting.window.radius() - radius);
                for centre in centres.iter_mut() {
                    *centre += more;
                }
                if !self.source.support.is_whole() {
                    usable_sums.sum(level, window, usable, (0, 2, 0), centres);
                }
                for p in 0..bias_planes::PLANES + if self.detail.is_some() { 2 } else { 0 } {
                    let (order, base) = bias_planes::place(p);
                    misfit_sums.sum(level, window, misfit, (p, order, base), centres);
                }
                for g in 0..rows.len() {
                    self.finish_row(group * GROUP_ROWS + g, g, left);
                }
            }
        }
    }

    /// The planes h of a tile, before smoothing: `scores` holds `way * UNKNOWNS + unknown`.
    fn scores(&mut self, left: usize, (top, bottom): (usize, usize)) {
        let Self { setting, source, strip, scratch, .. } = self;
        let Scratch { jets, motion, weights, scores, .. } = &mut **scratch;
        let (reach, spread) = (setting.reach, setting.squared.radius() + setting.smoothing.radius());
        let count = setting.pixel.mixing.len() * setting.unknowns();
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
        for r in 0..high {
            jets.row(setting.level, source, r);
            strip.motion_row(corner.0, corner.1 + r as isize, setting.scale, motion);
            let (motion, jets, weights) = (&motion[..], &*jets, &mut weights[..]);
            match setting.rows {
                1 => dispatch(setting.level, Weigh::<T, 1, 1> { setting, jets, motion, wide, weights }),
                3 => dispatch(setting.level, Weigh::<T, 3, 3> { setting, jets, motion, wide, weights }),
                6 => dispatch(setting.level, Weigh::<T, 6, 6> { setting, jets, motion, wide, weights }),
                _ => dispatch(setting.level, Weigh::<T, 12, 6> { setting, jets, motion, wide, weights }),
            }
            dispatch(setting.level, Scatter { taps: &setting.taps, weights, wide, row: (r, reach), scores });
        }
    }

    /// Smooths the planes h and multiplies them.
    fn products(&mut self, (top, bottom): (usize, usize)) {
        let Self { setting, scratch, .. } = self;
        let plan = setting.plan();
        let Scratch { scores, planes, row, smoothed, .. } = &mut **scratch;
        let (radius, spread) = (setting.squared.radius(), setting.smoothing.radius());
        let count = setting.pixel.mixing.len() * setting.unknowns();
        let (width, height) = (padded(TILE_COLUMNS + 2 * radius), bottom - top + 1 + 2 * radius);
        planes.resize(plan.planes(), width, height);
        row.resize(scores.width.max(padded(width + 2 * spread)), T::default());
        smoothed.resize(count * width, T::default());
        for r in 0..height {
            for (p, target) in smoothed.chunks_exact_mut(width).enumerate() {
                if spread == 0 {
                    let at = scores.at(p, r, 0);
                    target.copy_from_slice(&scores.data[at..at + width]);
                } else {
                    let taps = &setting.smoothing.taps;
                    let centre = (r + spread) * scores.width;
                    let plane = scores.plane(p);
                    let pass = Pass { source: plane, centre, stride: scores.width, len: scores.width, taps, out: row };
                    dispatch(setting.level, pass);
                    let pass = Pass { source: row, centre: spread, stride: 1, len: width, taps, out: target };
                    dispatch(setting.level, pass);
                }
            }
            if setting.rows == 1 {
                dispatch(setting.level, Outer::<T, 2> { plan, smoothed, planes, row: r });
            } else {
                dispatch(setting.level, Outer::<T, 6> { plan, smoothed, planes, row: r });
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

    /// The planes of the misfit and the detail, with the margin of the window.
    fn misfit(&mut self, left: usize, (top, bottom): (usize, usize)) {
        let Self { setting, source, detail, strip, scratch, .. } = self;
        let Scratch { jets, ring, misfit, .. } = &mut **scratch;
        let radius = setting.window.radius();
        let (width, height) = (padded(TILE_COLUMNS + 2 * radius), bottom - top + 1 + 2 * radius);
        misfit.resize(bias_planes::PLANES + if detail.is_some() { 2 } else { 0 }, width, height);
        let corner = (left as isize - radius as isize, top as isize - radius as isize);
        let kind = (setting.level, setting.rows);
        ring.fill(kind, &setting.truncation, (source, strip), jets, (corner, setting.scale), misfit);
        let Some(detail) = detail else { return };
        for r in 0..height {
            let y = corner.1 + r as isize;
            let at = misfit.at(bias_planes::PLANES, r, 0);
            source.support.weights(corner.0, y, &mut misfit.data[at..at + width]);
            let other = misfit.at(bias_planes::PLANES + 1, r, 0);
            let (energy, known) = misfit.data.split_at_mut(other);
            detail.row(corner.0, y, &mut energy[at..at + width], &mut known[..width]);
        }
    }

    /// Covariance of row `j` of the band, whose moments are row `g` of the group, at the columns of the tile
    /// that begins at `left`.
    fn finish_row(&mut self, j: usize, g: usize, left: usize) {
        self.gather(j, g, left);
        let Self { setting, scratch, .. } = self;
        let Scratch { sums, pixel, .. } = &mut **scratch;
        let row = MomentRow { data: &sums.data, first: g * TILE_COLUMNS, stride: GROUP_ROWS * TILE_COLUMNS };
        dispatch(setting.level, Sandwich { setting, row, pixel });
        let (width, count) = (self.columns.len(), (self.columns.end - left).min(TILE_COLUMNS));
        if keeps("windowed.noise_dominated") {
            noise_dominated::inflate_row(&setting.pixel, setting.scale, pixel, count);
        }
        let from = j * width + left - self.columns.start;
        for (k, plane) in self.out.iter_mut().enumerate() {
            let pixel = &self.scratch.pixel;
            let row = |first: usize| &pixel[(first + k % ENTRIES) * TILE_COLUMNS..][..count];
            let target = &mut plane[from..from + count];
            target.copy_from_slice(row(PIXEL_RESULT));
            if k >= ENTRIES {
                target.iter_mut().zip(row(PIXEL_NOISE)).for_each(|(whole, noise)| *whole -= *noise);
            }
        }
    }

    /// Copies what the strip and the window know of row `j` of the band to `Scratch::pixel`.
    fn gather(&mut self, j: usize, g: usize, left: usize) {
        let Self { setting, source, detail, strip, scratch, rows, columns, .. } = self;
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
        // With u = u0 + x u_x + y u_y the entry of u_x is that of u times x, and its own.
        let Scratch { misfit_sums, pixel, .. } = &mut **scratch;
        let moment = |k: usize| &misfit_sums.data[(k * GROUP_ROWS + g) * TILE_COLUMNS..][..TILE_COLUMNS];
        for p in 0..12 {
            let (first, i) = (p / 6 * bias_planes::SCORE, p % 6);
            let target = &mut pixel[(PIXEL_MISFIT + p) * TILE_COLUMNS..][..TILE_COLUMNS];
            target.copy_from_slice(moment(first + 3 * (i % 2) + i / 2));
            if i > 1 {
                target.iter_mut().zip(moment(first + 4 + i)).for_each(|(sum, own)| *sum += *own);
            }
        }
        for p in 12..bias_planes::PLANES + if detail.is_some() { 2 } else { 0 } {
            pixel[(PIXEL_MISFIT + p) * TILE_COLUMNS..][..TILE_COLUMNS].copy_from_slice(moment(bias_planes::place(p).1));
        }
    }
}
