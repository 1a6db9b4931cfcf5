//! The estimate itself: moments, normal equations, solution and status of every pixel of a strip of rows.

use super::rounding_floor;
use super::rows::Plan;
use super::solve::{Deficient, MomentRow, decompose, normal_matrix, right_side};
use super::tile::{GROUP_ROWS, JetTile, Moments, Planes, Source, TILE_COLUMNS, padded};
use super::window::Window;
use crate::flow::RankPolicy;
use crate::flow::symmetric::{ENTRIES, factor};
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use crate::types::Status;
use rayon::prelude::*;
use std::ops::Range;

/// Rows of one parallel task, at most; fixed, and each pixel's result depends on its own window only, so
/// threads cannot change it.
const TASK_ROWS: usize = 64;
/// Smallest share of a (squared) column that is independent of the others where an unknown counts as
/// determined.
const RANK_TOLERANCE: f64 = 1e-5;
/// Smallest share of the window's weight on usable pixels.
const MIN_WEIGHT: f64 = 0.1;

/// What the estimate needs beside the images.
pub(super) struct Setting<T> {
    /// The window of the normal equations.
    pub window: Window<T>,
    /// 1 / sigma of the window.
    pub scale: f64,
    /// Equations a pixel: 1, 3, 6 or 12.
    pub rows: usize,
    /// What to do with undetermined unknowns.
    pub policy: RankPolicy,
    /// Largest sum of squared gradients that rounding leaves of a constant image as bright as the brightest
    /// sample; below it the samples of the window decide.
    pub floor: f64,
    /// Instruction set.
    pub level: Level,
    /// Whether inverses of the normal matrices are kept.
    pub inverse: bool,
    /// Whether rank and condition number are wanted.
    pub diagnostics: bool,
}

/// Estimates at all columns `columns` of the image rows `rows`, as planes of `rows.len()` rows.
///
/// The motion is in the scaled unknowns `(u, v, s u_x, ...)`.
pub(super) struct Strip<T> {
    pub rows: Vec<usize>,
    pub columns: Range<usize>,
    /// Six planes.
    pub motion: Vec<T>,
    /// Weighted sum of the squared residuals.
    pub residual: Vec<T>,
    /// Weight of the usable pixels, of 1.
    pub weight: Vec<T>,
    /// 21 planes, or none.
    pub inverse: Vec<T>,
    /// Condition number, or nothing.
    pub condition: Vec<T>,
    pub rank: Vec<u8>,
    pub status: Vec<Status>,
}

impl<T: SimdReal> Strip<T> {
    /// Estimates everything in the strip, in parallel over bands of its rows.
    pub fn new(source: &Source<'_, T>, setting: &Setting<T>, rows: Vec<usize>, columns: Range<usize>) -> Self {
        let n = rows.len() * columns.len();
        let plane = |count: usize| vec![T::nan(); count * n];
        let mut strip = Self {
            motion: plane(6),
            residual: plane(1),
            weight: plane(1),
            inverse: plane(if setting.inverse { ENTRIES } else { 0 }),
            condition: plane(usize::from(setting.diagnostics)),
            rank: vec![0; n],
            status: vec![Status::Ok; n],
            rows,
            columns,
        };
        if n > 0 {
            let spacing = strip.rows.get(1).map_or(1, |second| second - strip.rows[0]);
            let task = (TASK_ROWS / spacing).max(1);
            strip.bands(task).into_par_iter().for_each_init(Scratch::new, |scratch, band| {
                BandTask { source, setting, scratch, band }.run();
            });
        }
        strip
    }

    /// Motion along the image row `y` from column `x` on, in px and frames: six rows of equal length in
    /// `out`; zero where there is no estimate.
    ///
    /// The strip must hold every row of its span.
    pub fn motion_row(&self, x: isize, y: isize, scale: f64, out: &mut [T]) {
        out.fill(T::default());
        let (width, n) = (self.columns.len(), self.rows.len() * self.columns.len());
        let Some(row) = self.rows.first().and_then(|top| usize::try_from(y).ok()?.checked_sub(*top)) else { return };
        if row >= self.rows.len() {
            return;
        }
        let length = out.len() / 6;
        let from = (self.columns.start as isize - x).clamp(0, length as isize) as usize;
        let to = (self.columns.end as isize - x).clamp(from as isize, length as isize) as usize;
        if from == to {
            return;
        }
        let start = row * width + (x + from as isize - self.columns.start as isize) as usize;
        for k in 0..6 {
            let unit = T::from_f64(if k < 2 { 1.0 } else { scale });
            let values = &self.motion[k * n + start..k * n + start + to - from];
            for (target, value) in out[k * length + from..k * length + to].iter_mut().zip(values) {
                *target = if value.finite() { *value * unit } else { T::default() };
            }
        }
    }

    /// Cuts the strip into bands of `task` rows.
    fn bands(&mut self, task: usize) -> Vec<Band<'_, T>> {
        let (width, n) = (self.columns.len(), self.rows.len() * self.columns.len());
        let mut bands: Vec<Band<'_, T>> = self
            .rows
            .chunks(task)
            .zip(self.residual.chunks_mut(task * width))
            .zip(self.weight.chunks_mut(task * width))
            .zip(self.rank.chunks_mut(task * width))
            .zip(self.status.chunks_mut(task * width))
            .map(|((((rows, residual), weight), rank), status)| Band {
                rows,
                columns: self.columns.clone(),
                motion: Vec::with_capacity(6),
                inverse: Vec::new(),
                condition: None,
                residual,
                weight,
                rank,
                status,
            })
            .collect();
        for plane in self.motion.chunks_mut(n) {
            bands.iter_mut().zip(plane.chunks_mut(task * width)).for_each(|(b, p)| b.motion.push(p));
        }
        for plane in self.inverse.chunks_mut(n) {
            bands.iter_mut().zip(plane.chunks_mut(task * width)).for_each(|(b, p)| b.inverse.push(p));
        }
        bands.iter_mut().zip(self.condition.chunks_mut(task * width)).for_each(|(b, p)| b.condition = Some(p));
        bands
    }
}

/// The part of a strip that one task fills.
struct Band<'a, T> {
    rows: &'a [usize],
    columns: Range<usize>,
    motion: Vec<&'a mut [T]>,
    inverse: Vec<&'a mut [T]>,
    condition: Option<&'a mut [T]>,
    residual: &'a mut [T],
    weight: &'a mut [T],
    rank: &'a mut [u8],
    status: &'a mut [Status],
}

impl<T: SimdReal> Band<'_, T> {
    /// No estimate at this place.
    fn clear(&mut self, at: usize) {
        let planes = self.motion.iter_mut().chain(&mut self.inverse).chain(std::iter::once(&mut self.residual));
        planes.for_each(|plane| plane[at] = T::nan());
    }
}

/// Buffers of one thread.
struct Scratch<T> {
    jets: JetTile<T>,
    planes: Planes<T>,
    moments: Moments<T>,
    solved: Vec<T>,
    /// Weight of the usable columns in the window of each column of the band.
    across: Vec<f64>,
}

impl<T: SimdReal> Scratch<T> {
    fn new() -> Self {
        Self {
            jets: JetTile::new(),
            planes: Planes::new(),
            moments: Moments::new(),
            solved: Vec::new(),
            across: Vec::new(),
        }
    }
}

/// Rows of `Scratch::solved`: motion, quality, largest diagonal entry, residual, inverse.
const SOLVED: usize = 9 + ENTRIES;

struct BandTask<'a, 'b, T> {
    source: &'a Source<'a, T>,
    setting: &'a Setting<T>,
    scratch: &'a mut Scratch<T>,
    band: Band<'b, T>,
}

impl<T: SimdReal> BandTask<'_, '_, T> {
    fn run(mut self) {
        let level = self.setting.level;
        let radius = self.setting.window.radius();
        let (Some(&top), Some(&bottom)) = (self.band.rows.first(), self.band.rows.last()) else { return };
        let plan = Plan::new(self.setting.rows);
        let whole = self.source.support.is_whole();
        let (width, height) = (padded(TILE_COLUMNS + 2 * radius), bottom - top + 1 + 2 * radius);
        self.scratch.solved.resize(SOLVED * TILE_COLUMNS, T::default());
        let inside = self.source.support.inside().0;
        let across = |x: usize| self.setting.window.partial(x, inside.start, inside.end)[0];
        self.scratch.across = self.band.columns.clone().map(across).collect();
        for left in self.band.columns.clone().step_by(TILE_COLUMNS) {
            let Scratch { jets, planes, .. } = &mut *self.scratch;
            planes.resize(plan.planes() + 1, width, height);
            let corner = (left as isize - radius as isize, top as isize - radius as isize);
            jets.load(self.source, corner, width, height);
            let rows = (level, self.setting.rows);
            planes.fill(rows, self.source, jets, T::from_f64(self.setting.scale), !whole);
            let groups = self.band.rows.len().div_ceil(GROUP_ROWS);
            for group in 0..groups {
                let first = group * GROUP_ROWS;
                let last = (first + GROUP_ROWS).min(self.band.rows.len());
                let mut centres = [0; GROUP_ROWS];
                for (centre, y) in centres.iter_mut().zip(&self.band.rows[first..last]) {
                    *centre = y - top + radius;
                }
                let centres = &centres[..last - first];
                let Scratch { planes, moments: sums, .. } = &mut *self.scratch;
                let window = &self.setting.window;
                for p in 0..plan.planes() {
                    sums.sum(level, window, planes, (p, plan.order(p), plan.base(p)), centres);
                }
                if !whole {
                    sums.sum(level, window, planes, (plan.planes(), 0, plan.base(plan.planes())), centres);
                }
                for j in first..last {
                    self.solve_row(j, j - first, left);
                }
            }
        }
    }

    /// Solves row `j` of the band, whose moments are row `g` of the group, at the columns of the tile that
    /// begins at `left`.
    fn solve_row(&mut self, j: usize, g: usize, left: usize) {
        let Scratch { moments: sums, solved, .. } = &mut *self.scratch;
        let row = MomentRow { data: &sums.data, first: g * TILE_COLUMNS, stride: GROUP_ROWS * TILE_COLUMNS };
        let (level, inverse) = (self.setting.level, self.setting.inverse);
        // Rows 1-6 and 1-12 have the same planes.
        match self.setting.rows {
            1 => dispatch(level, Solve::<T, 1> { row, solved, inverse }),
            3 => dispatch(level, Solve::<T, 3> { row, solved, inverse }),
            _ => dispatch(level, Solve::<T, 6> { row, solved, inverse }),
        }
        self.keep(j, g, left);
    }

    /// Judges the solutions of a row and copies them to the band. Not vectorised.
    fn keep(&mut self, j: usize, g: usize, left: usize) {
        let Self { source, setting, scratch, band } = self;
        let plan = Plan::new(setting.rows);
        let y = band.rows[j];
        let count = (band.columns.end - left).min(TILE_COLUMNS);
        let at = j * band.columns.len() + left - band.columns.start;
        let inside = source.support.inside().1;
        let down = setting.window.partial(y, inside.start, inside.end)[0];
        let place = |k: usize| (k * GROUP_ROWS + g) * TILE_COLUMNS;
        let solved = &scratch.solved;
        let planes = band.motion.iter_mut().chain(std::iter::once(&mut band.residual)).chain(&mut band.inverse);
        for (plane, k) in planes.zip([0, 1, 2, 3, 4, 5, 8].into_iter().chain(9..)) {
            plane[at..at + count].copy_from_slice(&solved[k * TILE_COLUMNS..k * TILE_COLUMNS + count]);
        }
        for c in 0..count {
            let (x, out) = (left + c, at + c);
            let weight = if source.support.is_whole() {
                down * scratch.across[x - band.columns.start]
            } else {
                scratch.moments.data[place(plan.base(plan.planes())) + c].to_f64()
            };
            band.weight[out] = T::from_f64(weight);
            let mut status = source.support.status(x, y);
            if status == Status::Ok && weight < MIN_WEIGHT {
                status = source.support.lack(x, y, setting.window.radius());
            }
            band.status[out] = status;
            if status != Status::Ok {
                band.clear(out);
                continue;
            }
            let quality = solved[6 * TILE_COLUMNS + c].to_f64();
            let largest = solved[7 * TILE_COLUMNS + c].to_f64();
            let floor = if largest > setting.floor {
                setting.floor
            } else {
                rounding_floor::about(&source.frames, (x, y), setting.window.radius(), source.reach)
            };
            let determined = quality >= RANK_TOLERANCE && largest > floor;
            if determined {
                band.rank[out] = 6;
            } else {
                band.clear(out);
            }
            if determined && !setting.diagnostics {
                continue;
            }
            let row =
                MomentRow { data: &scratch.moments.data, first: g * TILE_COLUMNS, stride: GROUP_ROWS * TILE_COLUMNS };
            let n = normal_matrix::<T, T>(plan, &row, c);
            let right = right_side::<T, T>(plan, &row, c);
            let Deficient { rank, solution, condition } = decompose(&n, &right, RANK_TOLERANCE, floor);
            if let Some(plane) = &mut band.condition {
                plane[out] = T::from_f64(condition);
            }
            if determined {
                continue;
            }
            band.rank[out] = rank.min(5);
            band.status[out] = Status::Unobservable;
            if setting.policy == RankPolicy::MinNorm {
                band.status[out] = Status::MinNorm;
                let mut residual = row.load::<T>(plan.base(plan.planes() - 1), c);
                for (k, plane) in band.motion.iter_mut().enumerate() {
                    plane[out] = T::from_f64(solution[k]);
                    residual -= plane[out] * right[k];
                }
                band.residual[out] = Lanes::max(residual, T::default());
            }
        }
    }
}

/// The normal equations of one row of a tile, solved.
struct Solve<'a, T, const ROWS: usize> {
    row: MomentRow<'a, T>,
    solved: &'a mut [T],
    inverse: bool,
}

impl<T: SimdReal, const ROWS: usize> Kernel<T> for Solve<'_, T, ROWS> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { row, solved, inverse } = self;
        let plan = Plan::new(ROWS);
        let energy = plan.base(plan.planes() - 1);
        let mut c = 0;
        while c < TILE_COLUMNS {
            let n = normal_matrix::<V, T>(plan, &row, c);
            let r = right_side::<V, T>(plan, &row, c);
            let f = factor(&n);
            let m = f.solve(&r);
            let mut residual = row.load::<V>(energy, c);
            for k in 0..6 {
                residual = m[k].neg_mul_add(r[k], residual);
                m[k].store(&mut solved[k * TILE_COLUMNS + c..]);
            }
            f.quality.store(&mut solved[6 * TILE_COLUMNS + c..]);
            f.largest.store(&mut solved[7 * TILE_COLUMNS + c..]);
            residual.max(V::zero()).store(&mut solved[8 * TILE_COLUMNS + c..]);
            if inverse {
                for (k, value) in f.inverse().into_iter().enumerate() {
                    value.store(&mut solved[(9 + k) * TILE_COLUMNS + c..]);
                }
            }
            c += V::LANES;
        }
    }
}
