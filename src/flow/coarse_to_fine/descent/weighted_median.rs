//! Weighted median of the flow beside motion boundaries.
//!
//! Smoothness terms let two motions meet anywhere in an untextured strip, and where a surface disappears, data
//! contradict both. Pictures say more: sites of one surface look alike. Beside a boundary each site takes the
//! median of the flow around it, weighted by likeness of brightness and by how well the motion there explains
//! the frames (D. Sun, S. Roth and M. J. Black, "A quantitative analysis of current practices in optical flow
//! estimation and the principles behind them", IJCV 106, 2014). Neighbours are extrapolated by their slopes,
//! so that affine motion stays what it is, unless a boundary made those slopes.

use crate::flow::coarse_to_fine::data_term::View;
use crate::flow::coarse_to_fine::extended::{Field, RIM};
use crate::flow::coarse_to_fine::plane_pool::PlanePool;
use crate::flow::coarse_to_fine::planes::{LEFT, Planes, SITE_SPACING};
use crate::parallel::for_each_band;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use rayon::prelude::*;
use std::ops::Range;

/// Half the side of the window, sites.
const REACH: usize = 5;
/// Sites of a window.
const WINDOW: usize = (2 * REACH + 1) * (2 * REACH + 1);
/// Distance, sites, over which second differences of the flow are taken.
const STEP: usize = 2;
/// Second difference of the flow, px of the level, that makes a boundary.
const BOUNDARY_DIFFERENCE: f64 = 1.25;
/// Second difference, px, beside which slopes count half.
const SLOPE_DIFFERENCE: f64 = 0.2;
/// Difference of brightness, as a share of its standard deviation, at which a neighbour's weight is a quarter.
const BRIGHTNESS_DIFFERENCE: f64 = 0.28;
/// Residual, standard deviations, at which a site's weight is a half.
const HALF_WEIGHT_RESIDUAL: f64 = 3.0;
/// Convergence of the flow, 1/frame, at which a site's weight is a half: one surface closes over another.
const HALF_WEIGHT_CONVERGENCE: f64 = 0.35;
/// Minimum weight of a site: where nothing is explained, all count alike.
const MIN_WEIGHT: f64 = 1e-3;
/// Distance, px, from the median at which a site moves half of it; smaller distances are noise.
const HALF_SHARE_DISTANCE: f64 = 0.2;
/// Maximum number of halvings of the range of a window's flow, and the range, px, that may remain.
const HALVINGS: usize = 10;
const RESOLUTION: f64 = 0.02;

/// Planes of a prepared level: flow, slopes over one site, brightness, weight.
const PREPARED: usize = 8;
const BRIGHTNESS: usize = 6;
const WEIGHT: usize = 7;

/// Standard deviations, grey levels, of the brightness and of the residual.
#[derive(Debug, Clone, Copy)]
pub(super) struct Deviations {
    pub brightness: f64,
    pub residual: f64,
}

/// Moves the flow of `motion` (px of the level that the `views` show) beside boundaries; slopes stay.
pub(super) fn weighted_median<T: SimdReal>(
    simd: Level,
    space: &PlanePool<T>,
    views: &[View<'_, T>],
    deviations: Deviations,
    motion: &mut Planes<T>,
) {
    let boundaries = Boundaries::of(simd, motion);
    if !boundaries.exist() {
        return;
    }
    let prepared = prepare(simd, space, views, deviations, motion, &boundaries);
    let (len, stride) = (motion.row_len(), motion.stride());
    for_each_band(motion.data_mut(), len, |_, rows, out| {
        dispatch(simd, Medians { prepared: &prepared, boundaries: &boundaries, rows, out, stride });
    });
    Field::keep(space, [prepared]);
}

/// Second differences of the flow, and the sites whose window holds a boundary.
struct Boundaries<T> {
    width: usize,
    /// Squared second difference, px^2, at each site.
    squares: Vec<T>,
    /// 1 beside a boundary, 0 elsewhere; some more values than sites.
    near: Vec<T>,
}

impl<T: SimdReal> Boundaries<T> {
    fn of(simd: Level, motion: &Planes<T>) -> Self {
        let (width, height) = (motion.width, motion.height);
        let zero = T::from_f64(0.0);
        let mut squares = vec![zero; width * height];
        for_each_band(&mut squares, width, |_, rows, out| {
            dispatch(simd, SecondDifferences { motion, rows, out });
        });
        let mut near = vec![zero; width * height + LEFT];
        let threshold = T::from_f64(BOUNDARY_DIFFERENCE * BOUNDARY_DIFFERENCE);
        let reached = |at: usize, count: usize| at.saturating_sub(REACH)..(at + REACH + 1).min(count);
        for (y, row) in squares.chunks_exact(width).enumerate() {
            let mut marked = 0;
            for x in (0..width).filter(|&x| threshold < row[x]) {
                let columns = reached(x, width);
                let fresh = columns.start.max(marked)..columns.end;
                marked = columns.end;
                for y in reached(y, height) {
                    near[y * width..][fresh.clone()].fill(T::from_f64(1.0));
                }
            }
        }
        Self { width, squares, near }
    }

    fn exist(&self) -> bool {
        let zero = T::from_f64(0.0);
        self.near.iter().any(|near| zero < *near)
    }
}

struct SecondDifferences<'a, T> {
    motion: &'a Planes<T>,
    rows: Range<usize>,
    out: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for SecondDifferences<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { motion, rows, out } = self;
        let (width, height, stride) = (motion.width, motion.height, motion.stride());
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
            out.copy_from_slice(&squares[..width]);
            // No second difference without both neighbours.
            for x in (0..STEP.min(width)).chain(width.saturating_sub(STEP)..width) {
                out[x] = T::from_f64(0.0);
            }
        }
    }
}

/// The planes that medians are taken of: slopes reduced beside boundaries, mean brightness of the warped views,
/// weights; the weight beyond the frame is zero.
fn prepare<T: SimdReal>(
    simd: Level,
    space: &PlanePool<T>,
    views: &[View<'_, T>],
    deviations: Deviations,
    motion: &Planes<T>,
    boundaries: &Boundaries<T>,
) -> Field<T> {
    let (width, height) = (motion.width, motion.height);
    let mut field = Field::make(space, width, height, PREPARED);
    field.data_mut().fill(T::from_f64(0.0));
    let len = field.row_len();
    let per_grey = 1.0 / (BRIGHTNESS_DIFFERENCE * deviations.brightness).max(f64::from(f32::MIN_POSITIVE));
    let per_residual = 1.0 / (HALF_WEIGHT_RESIDUAL * deviations.residual).max(f64::from(f32::MIN_POSITIVE));
    // Squared residuals, with room for lanes beside the sites.
    let mut residuals = space.planes(width, height, 1);
    let residual_len = residuals.row_len();
    let rows = &mut field.data_mut()[RIM * len..(RIM + height) * len];
    let residual_rows = residuals.data_mut().par_chunks_mut(residual_len);
    rows.par_chunks_mut(len).zip(residual_rows).enumerate().with_min_len(8).for_each(|(y, (row, residual))| {
        dispatch(simd, Copy { views, motion, boundaries, per_grey, per_residual, y, row, residual });
    });
    rows.par_chunks_mut(len).enumerate().with_min_len(8).for_each(|(y, row)| {
        dispatch(simd, Weigh { motion, residuals: &residuals, y, row });
    });
    space.keep(residuals);
    field
}

/// One row of the motion, the brightness and the squared residuals.
struct Copy<'a, T: SimdReal> {
    views: &'a [View<'a, T>],
    motion: &'a Planes<T>,
    boundaries: &'a Boundaries<T>,
    per_grey: f64,
    per_residual: f64,
    y: usize,
    row: &'a mut [T],
    residual: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Copy<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { views, motion, boundaries, per_grey, per_residual, y, row, residual } = self;
        let (width, stride) = (motion.width, motion.stride());
        let zero = T::from_f64(0.0);
        for k in 0..6 {
            row[k * stride + LEFT..][..width].copy_from_slice(motion.line(k, y));
        }
        let mut lines = vec![zero; 3 * stride];
        let (squares, rest) = lines.split_at_mut(stride);
        squares[..width].copy_from_slice(&boundaries.squares[y * width..(y + 1) * width]);
        let scale = V::constant(SLOPE_DIFFERENCE.powi(-2));
        for x in (0..motion.padded()).step_by(V::LANES) {
            let ratio = V::load(&squares[x..]) * scale;
            let kept = V::constant(SITE_SPACING) / ratio.mul_add(ratio, V::constant(1.0));
            for k in 2..6 {
                let slope = &mut row[k * stride + LEFT + x..];
                (V::load(slope) * kept).store(slope);
            }
        }
        let (xs, rest) = rest.split_at_mut(stride);
        let sample = rest;
        residual.fill(zero);
        let mut ys = vec![zero; stride];
        for view in views {
            for x in 0..width {
                xs[x] = T::from_f64(SITE_SPACING * x as f64) + view.time * row[LEFT + x];
                ys[x] = T::from_f64(SITE_SPACING * y as f64) + view.time * row[stride + LEFT + x];
            }
            view.spline.sample_row_in::<V>(&xs[..width], &ys[..width], &mut sample[..width]);
            let (mean, rate) = (view.mean * T::from_f64(per_grey), view.rate * T::from_f64(per_residual));
            for x in 0..width {
                row[BRIGHTNESS * stride + LEFT + x] += mean * sample[x];
                residual[LEFT + x] += rate * sample[x];
            }
        }
        for x in 0..width {
            residual[LEFT + x] *= residual[LEFT + x];
        }
        (residual[LEFT - 1], residual[LEFT + width]) = (residual[LEFT], residual[LEFT + width - 1]);
    }
}

/// Weights of one row: less where the motion does not explain the frames, or one surface closes over another.
struct Weigh<'a, T> {
    motion: &'a Planes<T>,
    residuals: &'a Planes<T>,
    y: usize,
    row: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Weigh<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { motion, residuals, y, row } = self;
        let (width, stride) = (motion.width, motion.stride());
        let (above, below) = (residuals.row(y.saturating_sub(1)), residuals.row((y + 1).min(motion.height - 1)));
        let (here, slopes) = (residuals.row(y), motion.row(y));
        let (half, one) = (V::constant(0.5), V::constant(1.0));
        let per_convergence = V::constant(1.0 / HALF_WEIGHT_CONVERGENCE);
        let weights = &mut row[WEIGHT * stride..][..stride];
        for x in (0..motion.padded()).step_by(V::LANES) {
            let mut energy = V::zero();
            for (at, share) in [(LEFT + x - 1, 0.25), (LEFT + x, 0.5), (LEFT + x + 1, 0.25)] {
                let column = half.mul_add(V::load(&above[at..]) + V::load(&below[at..]), V::load(&here[at..]));
                energy = column.mul_add(V::constant(0.5 * share), energy);
            }
            let divergence = V::load(&slopes[2 * stride + LEFT + x..]) + V::load(&slopes[5 * stride + LEFT + x..]);
            let convergence = divergence.min(V::zero()) * per_convergence;
            let weight = one / ((one + energy) * convergence.mul_add(convergence, one)) + V::constant(MIN_WEIGHT);
            weight.store(&mut weights[LEFT + x..]);
        }
        weights[LEFT + width..].fill(T::from_f64(0.0));
    }
}

struct Medians<'a, T: SimdReal> {
    prepared: &'a Field<T>,
    boundaries: &'a Boundaries<T>,
    rows: Range<usize>,
    out: &'a mut [T],
    stride: usize,
}

impl<T: SimdReal> Kernel<T> for Medians<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { prepared, boundaries, rows, out, stride } = self;
        let row_len = out.len() / rows.len().max(1);
        let mut window = Window::<V>::new();
        for (y, out) in rows.zip(out.chunks_exact_mut(row_len)) {
            let near = &boundaries.near[y * boundaries.width..];
            for x in (0..boundaries.width).step_by(V::LANES) {
                // Lanes beyond the last site are those of the next row; what they compute is not used.
                let near = &near[x..x + V::LANES];
                if !any_positive(near) {
                    continue;
                }
                window.read(prepared, x, y);
                let ((u, spread_u), (v, spread_v)) = (window.median(0), window.median(1));
                let (own_u, own_v) = (V::load(&out[LEFT + x..]), V::load(&out[stride + LEFT + x..]));
                let (du, dv) = (u - own_u, v - own_v);
                let least = V::constant(HALF_SHARE_DISTANCE * HALF_SHARE_DISTANCE);
                let spread = spread_u.mul_add(spread_u, spread_v.mul_add(spread_v, least));
                let ratio = du.mul_add(du, dv * dv) / spread;
                let square = ratio * ratio;
                let share = V::load(near) * square / (V::constant(1.0) + square);
                du.mul_add(share, own_u).store(&mut out[LEFT + x..]);
                dv.mul_add(share, own_v).store(&mut out[stride + LEFT + x..]);
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
            let row = &prepared.data()[row..row + prepared.row_len()];
            for dx in -reach..=reach {
                let at = (LEFT + x).wrapping_add_signed(dx);
                let (back, up) = (V::constant(-dx as f64), V::constant(-dy as f64));
                for k in 0..2 {
                    let along = V::load(&row[(2 + k) * stride + at..]).mul_add(back, V::load(&row[k * stride + at..]));
                    self.flow[k][n] = V::load(&row[(4 + k) * stride + at..]).mul_add(up, along);
                }
                let difference = V::load(&row[BRIGHTNESS * stride + at..]) - own;
                let unlike = difference.mul_add(difference, V::constant(1.0));
                let weight = V::load(&row[WEIGHT * stride + at..]) / (unlike * unlike);
                self.weights[n] = weight;
                self.total = self.total + weight;
                n += 1;
            }
        }
    }

    /// Weighted median of a component, px, and the mean distance from it.
    #[inline(always)]
    fn median(&self, k: usize) -> (V, V) {
        let flow = &self.flow[k];
        let (mut low, mut high) = (flow[0], flow[0]);
        for n in 1..WINDOW {
            low = low.min(flow[n]);
            high = high.max(flow[n]);
        }
        let half = self.total * V::constant(0.5);
        for _ in 0..HALVINGS {
            if !any_above(high - low, RESOLUTION) {
                break;
            }
            let middle = (low + high) * V::constant(0.5);
            let mut below = V::zero();
            for n in 0..WINDOW {
                below = below + V::select(flow[n].lt(middle), self.weights[n], V::zero());
            }
            let is_above = below.lt(half);
            (low, high) = (V::select(is_above, middle, low), V::select(is_above, high, middle));
        }
        let median = (low + high) * V::constant(0.5);
        let mut distances = V::zero();
        for n in 0..WINDOW {
            let distance = flow[n] - median;
            distances = self.weights[n].mul_add(distance.max(V::zero() - distance), distances);
        }
        (median, distances / self.total)
    }
}

#[inline(always)]
fn any_above<T: SimdReal, V: Lanes<Scalar = T>>(values: V, threshold: f64) -> bool {
    let mut lanes = [T::from_f64(0.0); LEFT];
    V::select(V::constant(threshold).lt(values), V::constant(1.0), V::zero()).store(&mut lanes);
    any_positive(&lanes)
}

#[inline(always)]
fn any_positive<T: SimdReal>(values: &[T]) -> bool {
    let mut most = T::from_f64(0.0);
    for value in values {
        most = if most < *value { *value } else { most };
    }
    T::from_f64(0.0) < most
}
