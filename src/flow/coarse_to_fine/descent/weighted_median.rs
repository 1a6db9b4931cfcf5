//! Motion boundaries: a weighted median of the flow around each site proposes, the frames decide.
//!
//! Smoothness terms let two motions meet anywhere in a strip beside their boundary, and what is hidden in
//! one frame contradicts both. Sites of one surface look alike: the median over a window, weighted by
//! likeness of brightness and by the share of the residual that the motion explains, finds the motion of the
//! site's own surface (D. Sun, S. Roth and M. J. Black, "A quantitative analysis of current practices in
//! optical flow estimation and the principles behind them", IJCV 106, 2014). A site takes it if
//! it explains the pixels around the site, or explains them better than the present motion; small objects
//! therefore remain.

use crate::ablation::keeps;
use crate::flow::coarse_to_fine::data_term::{View, is_usable};
use crate::flow::coarse_to_fine::extended::Field;
use crate::flow::coarse_to_fine::plane_pool::PlanePool;
use crate::flow::coarse_to_fine::planes::{LEFT, Planes, SITE_SPACING};
use crate::parallel::{self, for_each_band};
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use std::ops::Range;

/// Half the side of the window, sites; every second site of it counts, as on a chessboard.
const REACH: usize = 5;
const WINDOW: usize = (2 * REACH + 1) * (2 * REACH + 1) / 2 + 1;
/// Distance, sites, over which second differences of the flow are taken.
const STEP: usize = 2;
/// Minimum second difference of the flow beside which medians are tried, px of the level.
const MIN_SECOND_DIFFERENCE: f64 = 1.5;
/// Difference of brightness, as a share of its standard deviation, at which a neighbour's weight is a
/// quarter.
const BRIGHTNESS_DIFFERENCE: f64 = 0.28;
/// Residual, standard deviations, of which a motion explains half.
const HALF_EXPLAINED_RESIDUAL: f64 = 2.0;
/// Explained share, and gain in it, of which either is enough for a site to leave its motion.
const SUFFICIENT_SHARE: f64 = 0.5;
const MIN_GAIN: f64 = 0.05;
/// Halvings of the range of a window's flow: the iteration that follows settles the rest.
const HALVINGS: usize = 6;

/// Planes that medians are taken of: flow, brightness along it, explained share.
const PREPARED: usize = 4;
/// Rows of one task, before medians are taken.
const ROWS_PER_TASK: usize = 8;
const BRIGHTNESS: usize = 2;
const EXPLAINED: usize = 3;

/// Offsets, px, and weights of the pixels around a site whose residuals count for it.
const AROUND: [([f64; 2], f64); 5] =
    [([0.0, 0.0], 0.4), ([-1.0, 0.0], 0.15), ([1.0, 0.0], 0.15), ([0.0, -1.0], 0.15), ([0.0, 1.0], 0.15)];

/// Standard deviations, grey levels, of the brightness and of the residual.
#[derive(Debug, Clone, Copy)]
pub(super) struct BrightnessStd {
    pub picture: f64,
    pub residual: f64,
}

/// Moves the flow of `motion` (px of the level that the `views` show) beside boundaries; slopes stay.
pub(super) fn sharpen_boundaries<T: SimdReal>(
    simd: Level,
    space: &PlanePool<T>,
    views: &[View<'_, T>],
    std: BrightnessStd,
    motion: &mut Planes<T>,
) {
    let size = (motion.width, motion.height);
    let sites = beside_boundaries(simd, motion);
    if !sites.contains(&true) {
        return;
    }
    let positive = |std: f64| std.max(f64::from(f32::MIN_POSITIVE));
    let comparison = Along {
        views,
        per_picture: T::from_f64(1.0 / positive(BRIGHTNESS_DIFFERENCE * std.picture)),
        per_residual: T::from_f64(1.0 / positive(HALF_EXPLAINED_RESIDUAL * std.residual)),
    };
    let mut prepared = Field::make(space, size.0, size.1, PREPARED);
    prepared.data_mut().fill(T::from_f64(0.0));
    let (len, windows) = (prepared.row_len(), around(&sites, size));
    parallel::for_each(prepared.rows_mut().chunks_mut(ROWS_PER_TASK * len).enumerate(), |(task, rows)| {
        for (y, row) in (task * ROWS_PER_TASK..).zip(rows.chunks_mut(len)) {
            dispatch(simd, Prepare { along: &comparison, motion, y, sites: &windows[y * size.0..][..size.0], row });
        }
    });
    let len = motion.row_len();
    let stride = motion.stride();
    for_each_band(motion.data_mut(), len, |_, rows, out| {
        dispatch(simd, Medians { along: &comparison, prepared: &prepared, sites: &sites, rows, out, stride });
    });
    Field::keep(space, [prepared]);
}

/// Whether a site lies beside a motion boundary, row by row.
pub(in crate::flow::coarse_to_fine) fn beside_boundaries<T: SimdReal>(simd: Level, motion: &Planes<T>) -> Vec<bool> {
    around(&boundaries(simd, motion), (motion.width, motion.height))
}

/// Whether the second difference of the flow along a row or column is large, row by row.
fn boundaries<T: SimdReal>(simd: Level, motion: &Planes<T>) -> Vec<bool> {
    let mut out = vec![false; motion.width * motion.height];
    for_each_band(&mut out, motion.width, |_, rows, out| dispatch(simd, SecondDifferences { motion, rows, out }));
    out
}

struct SecondDifferences<'a, T> {
    motion: &'a Planes<T>,
    rows: Range<usize>,
    out: &'a mut [bool],
}

impl<T: SimdReal> Kernel<T> for SecondDifferences<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { motion, rows, out } = self;
        let (width, height, stride) = (motion.width, motion.height, motion.stride());
        let threshold = T::from_f64(MIN_SECOND_DIFFERENCE * MIN_SECOND_DIFFERENCE);
        let mut squares = vec![T::from_f64(0.0); motion.padded()];
        for (y, out) in rows.zip(out.chunks_exact_mut(width)) {
            let (above, below) = (motion.row(y.saturating_sub(STEP)), motion.row((y + STEP).min(height - 1)));
            let here = motion.row(y);
            for x in (0..motion.padded()).step_by(V::LANES) {
                let (mut along, mut across) = (V::zero(), V::zero());
                for k in 0..2 {
                    let at = k * stride + LEFT + x;
                    let twice = V::load(&here[at..]) + V::load(&here[at..]);
                    let of_row = twice - V::load(&here[at - STEP..]) - V::load(&here[at + STEP..]);
                    let of_column = twice - V::load(&above[at..]) - V::load(&below[at..]);
                    along = of_row.mul_add(of_row, along);
                    across = of_column.mul_add(of_column, across);
                }
                along.max(across).store(&mut squares[x..]);
            }
            // No second difference without both neighbours.
            for x in STEP..width.saturating_sub(STEP) {
                out[x] = threshold < squares[x];
            }
        }
    }
}

/// The sites in whose window one of the `marked` sites lies.
fn around(marked: &[bool], (width, height): (usize, usize)) -> Vec<bool> {
    let mut out = vec![false; width * height];
    let reached = |at: usize, count: usize| at.saturating_sub(REACH)..(at + REACH + 1).min(count);
    for (y, row) in marked.chunks_exact(width).enumerate() {
        let mut filled = 0;
        for x in (0..width).filter(|&x| row[x]) {
            let columns = reached(x, width);
            let fresh = columns.start.max(filled)..columns.end;
            filled = columns.end;
            for y in reached(y, height) {
                out[y * width..][fresh.clone()].fill(true);
            }
        }
    }
    out
}

/// What the views show along a motion.
struct Along<'a, T> {
    views: &'a [View<'a, T>],
    /// Inverse scales of brightness and residual.
    per_picture: T,
    per_residual: T,
}

impl<T: SimdReal> Along<'_, T> {
    /// Brightness and explained share of some sites of row `y`, given their columns and flow.
    #[inline(always)]
    fn sample<V: Lanes<Scalar = T>>(&self, y: usize, columns: &[usize], [u, v]: [&[T]; 2]) -> [Vec<T>; 2] {
        let zero = T::from_f64(0.0);
        let [mut brightness, mut explained] = [(); 2].map(|()| vec![zero; columns.len()]);
        let [mut xs, mut ys, mut sample, mut residual] = [(); 4].map(|()| vec![zero; columns.len()]);
        for (n, ([dx, dy], weight)) in AROUND.into_iter().enumerate() {
            residual.fill(zero);
            for view in self.views {
                for (i, &column) in columns.iter().enumerate() {
                    xs[i] = T::from_f64(SITE_SPACING * column as f64 + dx) + view.time * u[i];
                    ys[i] = T::from_f64(SITE_SPACING * y as f64 + dy) + view.time * v[i];
                }
                view.spline.sample_row_in::<V>(&xs, &ys, &mut sample);
                let (mean, rate) = (view.mean * self.per_picture, view.rate * self.per_residual);
                residual.iter_mut().zip(&sample).for_each(|(sum, sample)| *sum += rate * *sample);
                // No motion explains what is not seen.
                if let Some(mask) = view.usable {
                    let hidden = |i: usize| !is_usable(mask, xs[i], ys[i]);
                    (0..columns.len()).filter(|&i| hidden(i)).for_each(|i| residual[i] = T::from_f64(f64::INFINITY));
                }
                if n == 0 {
                    brightness.iter_mut().zip(&sample).for_each(|(sum, sample)| *sum += mean * *sample);
                }
            }
            let weight = T::from_f64(weight);
            for (sum, &residual) in explained.iter_mut().zip(&residual) {
                *sum += weight / (T::from_f64(1.0) + residual * residual);
            }
        }
        [brightness, explained]
    }
}

/// Fills one row of the planes that medians are taken of; the weight of other sites stays zero.
struct Prepare<'a, T: SimdReal> {
    along: &'a Along<'a, T>,
    motion: &'a Planes<T>,
    y: usize,
    sites: &'a [bool],
    row: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Prepare<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { along, motion, y, sites, row } = self;
        let (stride, flow) = (motion.stride(), [0, 1].map(|k| motion.line(k, y)));
        let columns: Vec<usize> = (0..sites.len()).filter(|&x| sites[x]).collect();
        let [u, v] = flow.map(|line| columns.iter().map(|&x| line[x]).collect::<Vec<T>>());
        let [brightness, explained] = along.sample::<V>(y, &columns, [&u, &v]);
        for (i, &x) in columns.iter().enumerate() {
            for (k, value) in [u[i], v[i], brightness[i], explained[i]].into_iter().enumerate() {
                row[k * stride + LEFT + x] = value;
            }
        }
    }
}

struct Medians<'a, T: SimdReal> {
    along: &'a Along<'a, T>,
    prepared: &'a Field<T>,
    sites: &'a [bool],
    rows: Range<usize>,
    out: &'a mut [T],
    stride: usize,
}

impl<T: SimdReal> Kernel<T> for Medians<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { along, prepared, sites, rows, out, stride } = self;
        let (width, row_len) = (prepared.width, out.len() / rows.len().max(1));
        let mut window = Window::<V>::new();
        let mut lanes = [(); 2].map(|()| vec![T::from_f64(0.0); prepared.padded()]);
        for (y, out) in rows.zip(out.chunks_exact_mut(row_len)) {
            let columns: Vec<usize> = (0..width).filter(|&x| sites[y * width + x]).collect();
            let mut next = 0;
            for &x in &columns {
                if x >= next {
                    let start = x - x % V::LANES;
                    window.read(prepared, start, y);
                    (0..2).for_each(|k| window.median(k).store(&mut lanes[k][start..]));
                    next = start + V::LANES;
                }
            }
            let medians = lanes.each_ref().map(|line| columns.iter().map(|&x| line[x]).collect::<Vec<T>>());
            let [_, explained] = along.sample::<V>(y, &columns, medians.each_ref().map(Vec::as_slice));
            let sufficient = if keeps("flow.sufficient_median") { SUFFICIENT_SHARE } else { f64::INFINITY };
            let (gain, sufficient) = (T::from_f64(MIN_GAIN), T::from_f64(sufficient));
            let known = &prepared.line(EXPLAINED, y as isize)[LEFT..];
            for (i, &x) in columns.iter().enumerate() {
                if explained[i] > (known[x] + gain).min(sufficient) {
                    (0..2).for_each(|k| out[k * stride + LEFT + x] = medians[k][i]);
                }
            }
        }
    }
}

/// The flow and weights around some sites.
struct Window<V> {
    flow: [[V; WINDOW]; 2],
    weights: [V; WINDOW],
    total: V,
}

impl<T: SimdReal, V: Lanes<Scalar = T>> Window<V> {
    fn new() -> Self {
        Self { flow: [[V::zero(); WINDOW]; 2], weights: [V::zero(); WINDOW], total: V::zero() }
    }

    #[inline(always)]
    fn read(&mut self, prepared: &Field<T>, x: usize, y: usize) {
        let (reach, stride) = (REACH as isize, prepared.stride());
        let own = V::load(&prepared.line(BRIGHTNESS, y as isize)[LEFT + x..]);
        self.total = V::zero();
        let mut n = 0;
        for dy in -reach..=reach {
            let row = prepared.start(0, y as isize + dy);
            let row = &prepared.data()[row..];
            for dx in (-reach..=reach).filter(|dx| (dx + dy) % 2 == 0) {
                let at = (LEFT + x).wrapping_add_signed(dx);
                (0..2).for_each(|k| self.flow[k][n] = V::load(&row[k * stride + at..]));
                let difference = V::load(&row[BRIGHTNESS * stride + at..]) - own;
                let unlike = difference.mul_add(difference, V::constant(1.0));
                let weight = V::load(&row[EXPLAINED * stride + at..]) / (unlike * unlike);
                self.weights[n] = weight;
                self.total = self.total + weight;
                n += 1;
            }
        }
    }

    /// Weighted median of a component, px.
    #[inline(always)]
    fn median(&self, k: usize) -> V {
        let flow = &self.flow[k];
        let (mut low, mut high) = (flow[0], flow[0]);
        for &value in &flow[1..] {
            low = low.min(value);
            high = high.max(value);
        }
        let half = self.total * V::constant(0.5);
        for _ in 0..HALVINGS {
            let middle = (low + high) * V::constant(0.5);
            let mut below = V::zero();
            for (&value, &weight) in flow.iter().zip(&self.weights) {
                below = below + V::select(value.lt(middle), weight, V::zero());
            }
            let is_above = below.lt(half);
            (low, high) = (V::select(is_above, middle, low), V::select(is_above, high, middle));
        }
        (low + high) * V::constant(0.5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Spline;
    use crate::types::Frame;

    const SIZE: (usize, usize) = (96, 40);
    const SHIFT: f64 = 4.0;

    /// Texture that rests left of pixel 40 and moves by [`SHIFT`] from there on, brighter; the flow steps at
    /// pixel `step`.
    fn sharpened(step: usize) -> Planes<f64> {
        let wave = |x: f64, y: f64| 20.0 * (0.9 * x + 0.3 * y).sin();
        let picture = |time: f64| {
            Frame::from_fn(SIZE.0, SIZE.1, |x, y| {
                let (x, y) = (x as f64, y as f64);
                let moves = x >= 40.0 + time * SHIFT;
                if moves { 80.0 + wave(x - time * SHIFT, y) } else { wave(x, y) }
            })
        };
        let splines = [-0.5, 0.5].map(|time| Spline::new(Level::SCALAR, &picture(time)));
        let views = View::pair([&splines[0], &splines[1]], [None, None]);
        let mut motion = Planes::new(SIZE.0 / 2, SIZE.1 / 2, 6);
        for y in 0..motion.height {
            for x in 0..motion.width {
                motion.line_mut(0, y)[x] = if 2 * x < step { 0.0 } else { SHIFT };
            }
        }
        let std = BrightnessStd { picture: 45.0, residual: 1.0 };
        sharpen_boundaries(Level::SCALAR, &PlanePool::default(), &views, std, &mut motion);
        motion
    }

    #[test]
    fn a_boundary_moves_to_the_edge_of_the_picture() {
        for step in [34, 40, 46] {
            let motion = sharpened(step);
            for y in 3..motion.height - 3 {
                let wrong = |x: usize| (motion.at(0, x, y) - if 2 * x < 40 { 0.0 } else { SHIFT }).abs();
                // What the moving surface hides or uncovers has no motion of its own.
                let seen = (8..motion.width - 8).filter(|&x| (2.0 * x as f64 - 40.0).abs() > 0.5 * SHIFT);
                assert!(seen.into_iter().all(|x| wrong(x) < 0.1), "{step}: {:?}", motion.line(0, y));
            }
        }
    }
}
