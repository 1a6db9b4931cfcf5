//! One row of tiles: what the increment needs, and the share of it that each pixel takes.
//!
//! Tiles overlap, so that each can be solved alone; their size does not depend on the number of threads.

use super::increment::solve;
use super::layout::{
    Columns, FLOW, INVERSE, LOWER, RATE, RATE_X, RATE_Y, RIGHT, RIM, SAMPLES, SEEN, TILE_COLUMNS, Tile, WEIGHT_LOWER,
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
const MEAN: usize = WEIGHT_RIGHT;
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
            let mut tile = Tile::new((start.width, start.height), &columns, &rows, &mut memory);
            tile.begin::<V>(views, start);
            solve::<T, V>(&mut tile, contrast);
            tile.finish::<V>(&columns, &rows, out);
        }
        space.keep(Planes::of_samples(memory));
    }
}

impl<T: SimdReal> Tile<'_, T> {
    /// Flow, differences, and the views' mean and rate with their derivatives.
    #[inline(always)]
    fn begin<V: Lanes<Scalar = T>>(&mut self, views: &[View<'_, T>], start: &Planes<T>) {
        (0..self.layout.size.1 + 2 * RIM).for_each(|y| self.read(start, y));
        let Tile { layout, columns, fields, weights, .. } = self;
        let (height, end) = (layout.size.1, LEFT + layout.size.0);
        for y in 0..height + 2 * RIM {
            let row = V::constant(layout.row(y) as f64);
            let (fields, means) = (&mut fields[y], &mut weights[y][MEAN]);
            for x in (LEFT - RIM..end + RIM).step_by(V::LANES) {
                let position = [V::load(&columns.number[x..]), row];
                let flow = [V::load(&fields[FLOW][x..]), V::load(&fields[FLOW + 1][x..])];
                let [mean, rate, seen] = sample_views(views, layout.frame, position, flow, V::constant(1.0));
                mean.store(&mut means[x..]);
                rate.store(&mut fields[RATE][x..]);
                seen.store(&mut fields[SEEN][x..]);
            }
            // Lanes beyond the tile have no data.
            fields[SEEN][end + RIM..].fill(T::from_f64(0.0));
        }
        // The slopes give way to differences.
        let half = V::constant(0.5);
        for y in RIM - 1..=RIM + height {
            let [here, below] = &mut fields[y..y + 2] else { unreachable!("two rows") };
            for x in (LEFT - 1..=end).step_by(V::LANES) {
                for k in 0..2 {
                    let (flow, slope) = (V::load(&here[FLOW + k][x..]), V::load(&here[RIGHT + k][x..]));
                    let implied = (slope + V::load(&here[RIGHT + k][x + 1..])) * half;
                    (V::load(&here[FLOW + k][x + 1..]) - flow - implied).store(&mut here[RIGHT + k][x..]);
                    let implied = (V::load(&here[LOWER + k][x..]) + V::load(&below[LOWER + k][x..])) * half;
                    (V::load(&below[FLOW + k][x..]) - flow - implied).store(&mut here[LOWER + k][x..]);
                }
            }
        }
        for y in 2..height + 2 * RIM - 2 {
            let around = [y - 2, y - 1, y + 1, y + 2];
            for x in (LEFT - RIM + 2..end + RIM - 2).step_by(V::LANES) {
                let means = &weights[y][MEAN];
                let mean_x = slope::<T, V>([-2, -1, 1, 2].map(|step| &means[x.wrapping_add_signed(step)..]));
                let mean_y = slope::<T, V>(around.map(|y| &weights[y][MEAN][x..]));
                let rates = &fields[y][RATE];
                let rate_x = slope::<T, V>([-2, -1, 1, 2].map(|step| &rates[x.wrapping_add_signed(step)..]));
                let rate_y = slope::<T, V>(around.map(|y| &fields[y][RATE][x..]));
                for (k, value) in [(X, mean_x), (Y, mean_y), (RATE_X, rate_x), (RATE_Y, rate_y)] {
                    value.store(&mut fields[y][k][x..]);
                }
            }
        }
        for y in layout.inner() {
            let around = [y - 2, y - 1, y + 1, y + 2];
            for x in (LEFT..end).step_by(V::LANES) {
                let slopes = &fields[y][X];
                let xx = slope::<T, V>([-2, -1, 1, 2].map(|step| &slopes[x.wrapping_add_signed(step)..]));
                let xy = slope::<T, V>(around.map(|y| &fields[y][X][x..]));
                let yy = slope::<T, V>(around.map(|y| &fields[y][Y][x..]));
                for (k, value) in [(XX, xx), (XY, xy), (YY, yy)] {
                    value.store(&mut fields[y][k][x..]);
                }
            }
        }
    }

    /// Copies flow and slopes of row `y`; beyond the frame its outermost.
    fn read(&mut self, start: &Planes<T>, y: usize) {
        let row = self.layout.row(y);
        let (first, last) = (self.layout.origin.0 as isize - RIM as isize, self.layout.frame.0 as isize - 1);
        let count = self.layout.size.0 + 2 * RIM;
        let before = (-first).max(0) as usize;
        let whole = (last + 1 - first.max(0)).min((count - before) as isize) as usize;
        let from = first.max(0) as usize;
        for (k, to) in self.fields[y][..6].iter_mut().enumerate() {
            let (line, to) = (start.line(k, row), &mut to[LEFT - RIM..][..count]);
            to[..before].fill(line[0]);
            to[before..before + whole].copy_from_slice(&line[from..from + whole]);
            to[before + whole..].fill(line[line.len() - 1]);
        }
    }

    /// Writes the share of the increment that the residual earns.
    #[inline(always)]
    fn finish<V: Lanes<Scalar = T>>(&mut self, columns: &Range<usize>, rows: &Range<usize>, out: &mut [T]) {
        let Tile { layout, columns: Columns { even, odd, .. }, fields, system, weights, increment: [increment, _] } =
            self;
        let (height, end) = (layout.size.1, LEFT + layout.size.0);
        for y in layout.inner() {
            let (fields, increment, out) = (&fields[y], &increment[y], &mut system[y]);
            for x in (LEFT..end).step_by(V::LANES) {
                let at = |k: usize| V::load(&fields[k][x..]);
                let counts = V::zero().lt(at(SEEN) * (V::load(&even[x..]) + V::load(&odd[x..])));
                let (du, dv) = (V::load(&increment[0][x..]), V::load(&increment[1][x..]));
                let before = at(RATE);
                let after = at(X).mul_add(du, at(Y).mul_add(dv, before));
                for (k, rate) in [(BEFORE, before), (AFTER, after)] {
                    V::select(counts, rate.max(-rate), V::zero()).store(&mut out[k][x..]);
                }
            }
        }
        let taps: [T; MEAN_REACH + 1] =
            std::array::from_fn(|k| T::from_f64((-0.5 * (k as f64 / MEAN_SIGMA).powi(2)).exp()));
        let stride = out.len() / rows.len();
        let (first, top) = (columns.start - layout.origin.0, rows.start - layout.origin.1 + RIM);
        for y in top..top + rows.len() {
            let means = &mut weights[y];
            let near = y.saturating_sub(MEAN_REACH).max(RIM)..(y + MEAN_REACH + 1).min(RIM + height);
            for x in (LEFT..end).step_by(V::LANES) {
                let mut sums = [V::zero(); 2];
                for n in near.clone() {
                    let weight = V::splat(taps[n.abs_diff(y)]);
                    for (sum, k) in sums.iter_mut().zip([BEFORE, AFTER]) {
                        *sum = V::load(&system[n][k][x..]).mul_add(weight, *sum);
                    }
                }
                sums[0].store(&mut means[BEFORE_DOWN][x..]);
                sums[1].store(&mut means[AFTER_DOWN][x..]);
            }
            for line in means.iter_mut() {
                line[..LEFT].fill(T::from_f64(0.0));
                line[end..].fill(T::from_f64(0.0));
            }
            for x in (0..columns.len()).step_by(V::LANES) {
                let at = LEFT + first + x;
                let mut sums = [V::zero(); 2];
                for (sum, k) in sums.iter_mut().zip([BEFORE_DOWN, AFTER_DOWN]) {
                    let line = &means[k];
                    *sum = V::load(&line[at..]) * V::splat(taps[0]);
                    for (n, &weight) in taps.iter().enumerate().skip(1) {
                        let pair = V::load(&line[at - n..]) + V::load(&line[at + n..]);
                        *sum = pair.mul_add(V::splat(weight), *sum);
                    }
                }
                let tiny = V::constant(f64::from(f32::MIN_POSITIVE));
                let fall = V::constant(1.0) - sums[1] / sums[0].max(tiny);
                let share = (fall * V::constant(1.0 / WHOLE_FALL)).max(V::zero()).min(V::constant(1.0));
                for k in 0..2 {
                    let to = (y - top) * stride + k * (stride / 2) + LEFT + columns.start + x;
                    (V::load(&increment[y][k][at..]) * share).store(&mut out[to..]);
                }
            }
        }
    }
}

/// Derivative by differences over two samples on either side; `around`: from two before to two after.
#[inline(always)]
fn slope<T: SimdReal, V: Lanes<Scalar = T>>(around: [&[T]; 4]) -> V {
    let [before, left, right, after] = around;
    let (near, far) = (V::load(right) - V::load(left), V::load(after) - V::load(before));
    near.mul_add(V::constant(8.0 / 12.0), far * V::constant(-1.0 / 12.0))
}
