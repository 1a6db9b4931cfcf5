//! The estimate itself: moments, normal equations, solution and status of every pixel of a strip of rows.

use super::moments::{Moments, Window};
use super::plan::Plan;
use super::solve::{normal_matrix, right_side};
use super::tile::{GROUP_ROWS, Grid, JetTile, Planes, Source, TILE_COLUMNS, padded};
use crate::flow::RankPolicy;
use crate::flow::symmetric::{ENTRIES, decompose, factor};
use crate::image::lagrange_at;
use crate::parallel;
use crate::simd::{Kernel, Lanes, SimdReal, dispatch};
use crate::types::{Frame, Status};
use std::ops::Range;

/// Smallest share of a squared column that the others leave independent where its unknown is determined.
const RANK_TOLERANCE: f64 = 1e-5;
/// Smallest share of the window's weight on usable pixels.
const MIN_WEIGHT: f64 = 0.1;
/// Gradients below the brightness times so many units of rounding are rounding noise.
const ROUNDING_STEPS: f64 = 8.0;
/// Samples are not carried farther than this, px: beyond it one window without a pyramid has failed.
const MAX_CARRY: f64 = 4.0;
/// Frames contradict a motion that leaves more than this share of their differences (jumps leave 0.4 to 0.99)
const MAX_LEFT: f64 = 0.4;
/// if these are as large as of a motion of so many px (jumps: 3 and more, noise: up to 1.5).
const MIN_CONTRADICTION: f64 = 2.5;
/// How far from a site samples can come from, px: with the pixels of the interpolation.
pub(super) const CARRY_REACH: usize = MAX_CARRY as usize + 2;

/// What the estimate needs beside the images.
#[derive(Clone)]
pub(super) struct Setting<T> {
    /// The window of the normal equations.
    pub window: Window<T>,
    /// 1 / sigma of the window.
    pub scale: f64,
    /// What to do with undetermined unknowns.
    pub policy: RankPolicy,
    /// Whether inverses of the normal matrices are kept.
    pub inverse: bool,
    /// Whether rank and condition number are wanted.
    pub diagnostics: bool,
}

/// Planes of a strip. Motion is in the scaled unknowns `(u, v, s u_x, ...)`.
pub(super) const MOTION: usize = 0;
/// Weighted sum of the squared residuals.
pub(super) const RESIDUAL: usize = 6;
/// Weight of the usable pixels, of 1. In the solved row: quality of the factor.
pub(super) const WEIGHT: usize = 7;
/// Condition number. In the solved row: largest diagonal entry of the normal matrix.
pub(super) const CONDITION: usize = 8;
/// Upper triangle of the inverse of the normal matrix, if it is kept.
pub(super) const INVERSE: usize = 9;
const PLANES: usize = INVERSE + ENTRIES;

/// Estimates at columns of evenly spaced image rows.
pub(super) struct Strip<T> {
    pub grid: Grid<T>,
    pub rank: Vec<u8>,
    pub status: Vec<Status>,
    /// Unit of length of the derivatives, 1/px.
    pub scale: f64,
}

impl<T: SimdReal> Strip<T> {
    /// Estimates everything in the strip, in parallel over bands of its rows.
    pub fn new(source: &Source<'_, T>, setting: &Setting<T>, rows: Vec<usize>, columns: Range<usize>) -> Self {
        let n = rows.len() * columns.len();
        let mut grid = Grid::new(rows, columns.clone(), if setting.inverse { PLANES } else { INVERSE });
        let (mut rank, mut status) = (vec![0; n], vec![Status::Ok; n]);
        let sites = grid.task_rows() * columns.len();
        let states = rank.chunks_mut(sites).zip(status.chunks_mut(sites));
        parallel::for_each(grid.tasks().zip(states), |((rows, values), (rank, status))| {
            let (scratch, columns) = (&mut Scratch::default(), columns.clone());
            Task { source, setting, scratch, rows, columns, values, rank, status }.run();
        });
        Self { grid, rank, status, scale: setting.scale }
    }

    /// Motion along the image row `y` from column `x` on, in px and frames: six rows of equal length in
    /// `out`; zero where there is no estimate. The strip must hold every row of its span.
    pub fn motion_row(&self, x: isize, y: isize, out: &mut [T]) {
        out.fill(T::default());
        let Some(j) = usize::try_from(y).ok().and_then(|y| self.grid.place(y)) else { return };
        let (columns, length) = (&self.grid.columns, out.len() / 6);
        let from = (columns.start as isize - x).clamp(0, length as isize) as usize;
        let to = (columns.end as isize - x).clamp(from as isize, length as isize) as usize;
        for (k, out) in out.chunks_exact_mut(length).enumerate().filter(|_| from < to) {
            let unit = T::from_f64(if k < 2 { 1.0 } else { self.scale });
            let start = (x + from as isize - columns.start as isize) as usize;
            for (target, value) in out[from..to].iter_mut().zip(&self.grid.row(MOTION + k, j)[start..]) {
                *target = if value.finite() { *value * unit } else { T::default() };
            }
        }
    }

    /// The frame at `time` (frames from the moment of the estimate) carried to that moment along the steady
    /// affine motion of each pixel, `p + t m + t^2 / 2 M m`. A sample without brightness to come from stays.
    /// Errors of cubic convolution would hide up to two thirds of the bias that carried frames show.
    pub fn carry(&self, frame: &Frame<T>, time: f64) -> Frame<T> {
        let mut out = frame.clone();
        let (columns, length) = (self.grid.columns.clone(), self.grid.columns.len());
        let rows = out.data_mut().chunks_mut(frame.width()).enumerate();
        parallel::for_each(rows.skip(self.grid.rows[0]).take(self.grid.rows.len()), |(y, out)| {
            let mut motion = vec![T::default(); 6 * length];
            self.motion_row(columns.start as isize, y as isize, &mut motion);
            for (c, out) in out[columns.clone()].iter_mut().enumerate() {
                let [u, v, u_x, v_x, u_y, v_y] = std::array::from_fn(|k| motion[k * length + c].to_f64());
                let dx = time * (u + 0.5 * time * (u_x * u + u_y * v));
                let dy = time * (v + 0.5 * time * (v_x * u + v_y * v));
                if dx.hypot(dy) < MAX_CARRY {
                    let value = lagrange_at(frame, (columns.start + c) as f64 + dx, y as f64 + dy);
                    *out = if value.finite() { value } else { *out };
                }
            }
        });
        out
    }
}

/// Buffers of one task.
#[derive(Default)]
struct Scratch<T> {
    jets: JetTile<T>,
    planes: Planes<T>,
    sums: Moments<T>,
    /// The planes of one row of a tile, as the strip holds them.
    solved: Vec<T>,
}

/// A band of rows.
struct Task<'a, T> {
    source: &'a Source<'a, T>,
    setting: &'a Setting<T>,
    scratch: &'a mut Scratch<T>,
    rows: &'a [usize],
    columns: Range<usize>,
    values: &'a mut [T],
    rank: &'a mut [u8],
    status: &'a mut [Status],
}

impl<T: SimdReal> Task<'_, T> {
    fn run(mut self) {
        let Self { source, setting, .. } = self;
        let radius = setting.window.radius();
        let (top, bottom) = (self.rows[0], self.rows[self.rows.len() - 1]);
        let plan = Plan::of_rows(source.rows);
        let (width, height) = (padded(TILE_COLUMNS + 2 * radius), bottom - top + 1 + 2 * radius);
        self.scratch.solved.resize(PLANES * TILE_COLUMNS, T::default());
        for left in self.columns.clone().step_by(TILE_COLUMNS) {
            let Scratch { jets, planes, .. } = &mut *self.scratch;
            planes.resize(plan.planes(), width, height);
            let corner = (left as isize - radius as isize, top as isize - radius as isize);
            jets.load(source, corner, width, height);
            planes.fill(source, jets, T::from_f64(setting.scale));
            for (group, rows) in self.rows.chunks(GROUP_ROWS).enumerate() {
                let Scratch { planes, sums, .. } = &mut *self.scratch;
                let centres: Vec<usize> = rows.iter().map(|y| y - top + radius).collect();
                sums.sum(source.level, &setting.window, planes, (plan, plan.brightness()), &centres);
                for g in 0..rows.len() {
                    self.solve_row(group * GROUP_ROWS + g, g, left);
                }
            }
        }
    }

    /// Solves row `j` of the band, whose moments are row `g` of the group, at the columns of the tile that
    /// begins at `left`; judges the solutions.
    fn solve_row(&mut self, j: usize, g: usize, left: usize) {
        let Self { source, setting, scratch, rows, columns, values, rank, status } = self;
        let Scratch { planes: pixels, sums, solved, .. } = &mut **scratch;
        let plan = Plan::of_rows(source.rows);
        let (inverse, radius) = (setting.inverse, setting.window.radius());
        match source.rows {
            1 => dispatch(source.level, Solve::<T, 1> { sums, g, solved, inverse }),
            3 => dispatch(source.level, Solve::<T, 3> { sums, g, solved, inverse }),
            _ => dispatch(source.level, Solve::<T, 6> { sums, g, solved, inverse }),
        }
        // Where gradients are rounding errors, the brightness is that of the whole window.
        let weights = sums.row(plan.base(plan.weight()), g);
        let brightness = pixels.at(plan.brightness(), rows[j] - rows[0] + radius, radius);
        let (width, y) = (columns.len(), rows[j]);
        let (from, count) = (left - columns.start, (columns.end - left).min(TILE_COLUMNS));
        let planes = values.len() / (rows.len() * width);
        let values = &mut values[j * planes * width..(j + 1) * planes * width];
        for (row, solved) in values.chunks_exact_mut(width).zip(solved.chunks_exact(TILE_COLUMNS)) {
            row[from..from + count].copy_from_slice(&solved[..count]);
        }
        let rounding = (ROUNDING_STEPS * if size_of::<T>() == 4 { f32::EPSILON.into() } else { f64::EPSILON }).powi(2);
        for c in 0..count {
            let (x, out) = (left + c, from + c);
            let weight = weights[c];
            let mut set = |plane: usize, value: T| values[plane * width + out] = value;
            set(WEIGHT, weight);
            set(CONDITION, T::nan());
            let mut found = source.support.status(x, y);
            if found == Status::Ok && weight.to_f64() < MIN_WEIGHT {
                found = source.support.lack(x, y, radius);
            }
            let quality = solved[WEIGHT * TILE_COLUMNS + c].to_f64();
            let largest = solved[CONDITION * TILE_COLUMNS + c].to_f64();
            let floor = rounding * pixels.data[brightness + c].to_f64();
            let determined = quality >= RANK_TOLERANCE && largest > floor;
            if found == Status::Ok && determined {
                rank[j * width + out] = 6;
            } else {
                // A damaged pixel still moves like its window; at the frame's edge that would leave it.
                let damaged = matches!(found, Status::Masked | Status::NonFinite);
                let moves = damaged && determined && weight.to_f64() >= MIN_WEIGHT;
                let first = if moves { RESIDUAL } else { MOTION };
                (first..=RESIDUAL).chain(INVERSE..planes).for_each(|plane| set(plane, T::nan()));
            }
            if found == Status::Ok && (!determined || setting.diagnostics) {
                let right = right_side::<T, T>(plan, sums, (g, c));
                let normal = normal_matrix::<T, T>(plan, sums, (g, c));
                let (seen, solution, condition) = decompose(&normal, &right, RANK_TOLERANCE, floor);
                set(CONDITION, T::from_f64(condition));
                if !determined {
                    rank[j * width + out] = seen.min(5);
                    found = Status::Unobservable;
                }
                if !determined && setting.policy == RankPolicy::MinNorm {
                    found = Status::MinNorm;
                    let mut residual = sums.row(plan.base(plan.energy()), g)[c];
                    for (k, (value, right)) in solution.map(T::from_f64).into_iter().zip(right).enumerate() {
                        set(MOTION + k, value);
                        residual -= value * right;
                    }
                    set(RESIDUAL, Lanes::max(residual, T::default()));
                }
            }
            let differences = sums.row(plan.base(plan.energy()), g)[c].to_f64();
            let left = solved[RESIDUAL * TILE_COLUMNS + c].to_f64() > MAX_LEFT * differences;
            if found == Status::Ok && left && differences > MIN_CONTRADICTION.powi(2) * largest {
                found = Status::Inconsistent;
            }
            status[j * width + out] = found;
        }
    }
}

/// The normal equations of one row of a tile, solved.
struct Solve<'a, T, const ROWS: usize> {
    sums: &'a Moments<T>,
    g: usize,
    solved: &'a mut [T],
    inverse: bool,
}

impl<T: SimdReal, const ROWS: usize> Kernel<T> for Solve<'_, T, ROWS> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { sums, g, solved, inverse } = self;
        let plan = Plan::of_rows(ROWS);
        let mut c = 0;
        while c < TILE_COLUMNS {
            let right = right_side::<V, T>(plan, sums, (g, c));
            let factor = factor(&normal_matrix::<V, T>(plan, sums, (g, c)));
            let motion = factor.solve(&right);
            let mut residual = sums.load::<V>(plan, Some(plan.energy()), 0, (g, c));
            for k in 0..6 {
                residual = motion[k].neg_mul_add(right[k], residual);
            }
            let mut rows = solved.chunks_exact_mut(TILE_COLUMNS);
            let values = motion.into_iter().chain([residual.max(V::zero()), factor.quality, factor.largest]);
            for (value, row) in values.zip(rows.by_ref()) {
                value.store(&mut row[c..]);
            }
            if inverse {
                for (value, row) in factor.inverse().into_iter().zip(rows) {
                    value.store(&mut row[c..]);
                }
            }
            c += V::LANES;
        }
    }
}
