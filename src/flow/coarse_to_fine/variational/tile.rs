//! One row of tiles: what the increment needs, and the share of it that each pixel takes.
//!
//! Tiles overlap, so that each can be solved alone; their size does not depend on the number of threads.

use super::increment::solve;
use super::layout::{
    D, FLOW, INVERSE, LOWER, RATE, RATE_X, RATE_Y, RIGHT, RIM, SAMPLES, SEEN, TILE_COLUMNS, Tile, WEIGHT, WEIGHT_LOWER,
    WEIGHT_RIGHT, X, XX, XY, Y, YY,
};
use crate::flow::coarse_to_fine::data_term::{View, sample_views};
use crate::flow::coarse_to_fine::plane_pool::PlanePool;
use crate::flow::coarse_to_fine::planes::{LEFT, Planes};
use crate::simd::{Kernel, Lanes, SimdReal};
use std::ops::Range;

/// Standard deviation of the Gaussian over which the residual is averaged, px, and its reach.
const MEAN_SIGMA: f64 = 3.0;
const MEAN_REACH: usize = 6;
/// Fall of the mean residual, as a share of it, that earns the whole increment.
const WHOLE_FALL: f64 = 0.1;

/// In the memory of planes that are not needed at the same time: the mean brightness; residuals before and
/// after, and their means down the columns.
const MEAN: usize = WEIGHT;
const BEFORE: usize = INVERSE;
const AFTER: usize = INVERSE + 1;
const BEFORE_DOWN: usize = WEIGHT_RIGHT;
const AFTER_DOWN: usize = WEIGHT_LOWER;

/// The pixel rows `rows`, written to the rows of `out`: what `u` and `v` move by.
pub(super) struct TileRow<'a, T> {
    pub space: &'a PlanePool<T>,
    pub views: &'a [View<'a, T>],
    /// Standard deviation of the brightness, grey levels.
    pub contrast: f64,
    /// Motion at every pixel.
    pub start: &'a Planes<T>,
    pub rows: Range<usize>,
    pub out: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for TileRow<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { space, views, contrast, start, rows, out } = self;
        let mut memory = space.samples(SAMPLES);
        for from in (0..start.width).step_by(TILE_COLUMNS) {
            let columns = from..(from + TILE_COLUMNS).min(start.width);
            let mut tile = Tile::new((start.width, start.height), &columns, &rows, memory);
            tile.begin::<V>(views, start);
            solve::<T, V>(&mut tile, contrast);
            tile.finish::<V>(views, (&columns, &rows), out);
            memory = tile.data;
        }
        space.keep(Planes::of_samples(memory));
    }
}

impl<T: SimdReal> Tile<T> {
    /// Flow, differences, and the views' mean and rate with their derivatives.
    #[inline(always)]
    fn begin<V: Lanes<Scalar = T>>(&mut self, views: &[View<'_, T>], start: &Planes<T>) {
        let (width, height) = self.layout.size;
        for y in 0..height + 2 * RIM {
            self.read(start, y);
            let row = V::constant(self.layout.row(y) as f64);
            for x in (0..width + 2 * RIM).step_by(V::LANES) {
                let at = |k: usize| self.layout.at(k, y) - RIM;
                let column = V::load(&self.columns.number[x..]);
                let flow = [self.load(at(FLOW) + x), self.load(at(FLOW + 1) + x)];
                let [mean, rate, seen] = sample_views(views, self.layout.frame, [column, row], flow, V::constant(1.0));
                let places = [at(MEAN) + x, at(RATE) + x, at(SEEN) + x];
                for (place, value) in places.into_iter().zip([mean, rate, seen]) {
                    self.store(place, value);
                }
            }
        }
        // The slopes give way to differences.
        let half = V::constant(0.5);
        let down = self.layout.down();
        for y in RIM - 1..=RIM + height {
            for x in (0..width + 2).step_by(V::LANES) {
                for k in 0..2 {
                    let flow = self.layout.at(FLOW + k, y) - 1 + x;
                    let here = self.load::<V>(flow);
                    for (gap, step) in [(RIGHT, 1), (LOWER, down)] {
                        let at = self.layout.at(gap + k, y) - 1 + x;
                        let implied = (self.load::<V>(at) + self.load(at + step)) * half;
                        self.store(at, self.load::<V>(flow + step) - here - implied);
                    }
                }
            }
        }
        for y in 2..height + 2 * RIM - 2 {
            for x in (0..width + 2 * RIM - 4).step_by(V::LANES) {
                let at = |k: usize| self.layout.at(k, y) - RIM + 2 + x;
                let places = [(MEAN, 1, X), (MEAN, down, Y), (RATE, 1, RATE_X), (RATE, down, RATE_Y)];
                for (from, step, to) in places.map(|(from, step, to)| (at(from), step, at(to))) {
                    self.store(to, self.slope::<V>(from, step));
                }
            }
        }
        for y in self.layout.inner() {
            for x in (0..width).step_by(V::LANES) {
                let at = |k: usize| self.layout.at(k, y) + x;
                let places = [(at(X), 1, at(XX)), (at(X), down, at(XY)), (at(Y), down, at(YY))];
                for (from, step, to) in places {
                    self.store(to, self.slope::<V>(from, step));
                }
            }
        }
    }

    /// Copies flow and slopes of row `y`; beyond the frame its outermost.
    fn read(&mut self, start: &Planes<T>, y: usize) {
        let row = self.layout.row(y);
        let (first, last) = (self.layout.origin.0 as isize - RIM as isize, self.layout.frame.0 as isize - 1);
        for k in 0..6 {
            let (line, to) = (start.line(k, row), self.layout.at(k, y) - RIM);
            let count = self.layout.size.0 + 2 * RIM;
            let before = (-first).max(0) as usize;
            let whole = (last + 1 - first.max(0)).min((count - before) as isize) as usize;
            let from = first.max(0) as usize;
            self.data[to..to + before].fill(line[0]);
            self.data[to + before..to + before + whole].copy_from_slice(&line[from..from + whole]);
            self.data[to + before + whole..to + count].fill(line[line.len() - 1]);
        }
    }

    /// Derivative at a sample, by differences over two samples `step` apart on either side.
    #[inline(always)]
    fn slope<V: Lanes<Scalar = T>>(&self, at: usize, step: usize) -> V {
        let near = self.load::<V>(at + step) - self.load(at - step);
        let far = self.load::<V>(at + 2 * step) - self.load(at - 2 * step);
        near.mul_add(V::constant(8.0 / 12.0), far * V::constant(-1.0 / 12.0))
    }

    /// Writes the share of the increment that the residual earns.
    #[inline(always)]
    fn finish<V: Lanes<Scalar = T>>(
        &mut self,
        views: &[View<'_, T>],
        (columns, rows): (&Range<usize>, &Range<usize>),
        out: &mut [T],
    ) {
        let (width, _) = self.layout.size;
        for y in self.layout.inner() {
            let row = V::constant(self.layout.row(y) as f64);
            for k in [BEFORE, AFTER] {
                let at = self.layout.at(k, y) - LEFT;
                self.data[at..at + self.layout.stride].fill(T::from_f64(0.0));
            }
            for x in (0..width).step_by(V::LANES) {
                let at = |k: usize| self.layout.at(k, y) + x;
                let column = V::load(&self.columns.number[RIM + x..]);
                let u = self.load::<V>(at(FLOW)) + self.load(at(D));
                let v = self.load::<V>(at(FLOW + 1)) + self.load(at(D + 1));
                let inside = V::load(&self.columns.even[x..]) + V::load(&self.columns.odd[x..]);
                let seen = self.load::<V>(at(SEEN)) * inside;
                let [_, rate, seen] = sample_views(views, self.layout.frame, [column, row], [u, v], seen);
                let counts = V::zero().lt(seen);
                let places = [at(BEFORE), at(AFTER)];
                for (place, rate) in places.into_iter().zip([self.load::<V>(at(RATE)), rate]) {
                    self.store(place, V::select(counts, rate.max(-rate), V::zero()));
                }
            }
        }
        let taps: [T; MEAN_REACH + 1] =
            std::array::from_fn(|k| T::from_f64((-0.5 * (k as f64 / MEAN_SIGMA).powi(2)).exp()));
        let stride = out.len() / rows.len();
        let (first, top) = (columns.start - self.layout.origin.0, rows.start - self.layout.origin.1 + RIM);
        for y in top..top + rows.len() {
            for x in (0..width).step_by(V::LANES) {
                let mut sums = [V::zero(); 2];
                for n in y.saturating_sub(MEAN_REACH).max(RIM)..(y + MEAN_REACH + 1).min(RIM + self.layout.size.1) {
                    let weight = V::splat(taps[n.abs_diff(y)]);
                    for (sum, k) in sums.iter_mut().zip([BEFORE, AFTER]) {
                        *sum = self.load::<V>(self.layout.at(k, n) + x).mul_add(weight, *sum);
                    }
                }
                for (k, sum) in [BEFORE_DOWN, AFTER_DOWN].into_iter().zip(sums) {
                    let to = self.layout.at(k, y) + x;
                    self.store(to, sum);
                }
            }
            for k in [BEFORE_DOWN, AFTER_DOWN] {
                let at = self.layout.at(k, y);
                self.data[at - LEFT..at].fill(T::from_f64(0.0));
                self.data[at + width..at - LEFT + self.layout.stride].fill(T::from_f64(0.0));
            }
            for x in (0..columns.len()).step_by(V::LANES) {
                let mut sums = [V::zero(); 2];
                for (sum, k) in sums.iter_mut().zip([BEFORE_DOWN, AFTER_DOWN]) {
                    let at = self.layout.at(k, y) + first + x;
                    for (n, &weight) in taps.iter().enumerate() {
                        let pair = if n == 0 { self.load::<V>(at) } else { self.load::<V>(at - n) + self.load(at + n) };
                        *sum = pair.mul_add(V::splat(weight), *sum);
                    }
                }
                let tiny = V::constant(f64::from(f32::MIN_POSITIVE));
                let fall = V::constant(1.0) - sums[1] / sums[0].max(tiny);
                let share = (fall * V::constant(1.0 / WHOLE_FALL)).max(V::zero()).min(V::constant(1.0));
                for k in 0..2 {
                    let to = (y - top) * stride + k * (stride / 2) + LEFT + columns.start + x;
                    (self.load::<V>(self.layout.at(D + k, y) + first + x) * share).store(&mut out[to..]);
                }
            }
        }
    }
}
