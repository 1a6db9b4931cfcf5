//! Affine fits to the flow in Gaussian windows, and the grids they are computed on.

use super::{ladder::EXTRA_PASSES, ladder::Scale, ladder::TERMS, ladder::Taps};
use crate::flow::coarse_to_fine::extended::{Continuation, Field, RIM};
use crate::flow::coarse_to_fine::plane_pool::PlanePool;
use crate::flow::coarse_to_fine::planes::LEFT;
use crate::flow::moment_filter::filter;
use crate::parallel::for_each_band;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use std::ops::Range;

/// Planes of flow to be fitted: u, v and the mean of `u^2 + v^2` (before u and v were smoothed).
pub(super) const FLOW: usize = 3;
/// Planes of a fit: u, v, u_x, v_x, u_y, v_y and the misfit's variance in the window, px^2.
pub(super) const FIT: usize = 7;
/// Minimum misfit, px^2: below it, rounding.
pub(super) const MIN_MISFIT: f64 = 1e-6;

/// The six values of the fit to planes 0 and 1 of `from` along row `y`, to `out`; `down`: four lines.
#[inline(always)]
pub(super) fn fit_row<V: Lanes>(
    from: &Field<V::Scalar>,
    taps: &Taps<V::Scalar>,
    y: usize,
    down: &mut [V::Scalar],
    out: &mut [V::Scalar],
) {
    let (stride, padded, taps) = (from.stride(), from.padded(), taps.taps.as_slice());
    for k in 0..2 {
        let (mean, slope) = down[2 * k * stride..].split_at_mut(stride);
        filter::<V, 2>(from.data(), from.start(k, y as isize), from.row_len(), stride, taps, [mean, slope]);
    }
    for k in 0..2 {
        let (mean, slope) = down[2 * k * stride..2 * (k + 1) * stride].split_at(stride);
        let mut lines = out.chunks_exact_mut(stride).skip(k).step_by(2).map(|line| &mut line[LEFT..]);
        let (Some(value), Some(along), Some(across)) = (lines.next(), lines.next(), lines.next()) else { return };
        filter::<V, 2>(mean, LEFT, 1, padded, taps, [value, along]);
        filter::<V, 1>(slope, LEFT, 1, padded, taps, [across]);
    }
}

struct Fits<'a, T> {
    from: &'a Field<T>,
    scale: &'a Scale<T>,
    rows: Range<usize>,
    out: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Fits<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { from, scale, rows, out } = self;
        let (stride, padded, taps) = (from.stride(), from.padded(), scale.first.taps.as_slice());
        let mut down = vec![T::from_f64(0.0); 4 * stride];
        let variance = V::constant(scale.variance);
        for (y, out) in rows.zip(out.chunks_exact_mut(FIT * stride)) {
            fit_row::<V>(from, &scale.first, y, &mut down, out);
            filter::<V, 1>(from.data(), from.start(2, y as isize), from.row_len(), stride, taps, [&mut down[..stride]]);
            let (fit, square) = out.split_at_mut((FIT - 1) * stride);
            let square = &mut square[LEFT..];
            filter::<V, 1>(&down[..stride], LEFT, 1, padded, taps, [&mut *square]);
            for x in (0..padded).step_by(V::LANES) {
                let (u, v) = (V::load(&fit[LEFT + x..]), V::load(&fit[stride + LEFT + x..]));
                let mut slopes = V::zero();
                for k in 2..6 {
                    let slope = V::load(&fit[k * stride + LEFT + x..]);
                    slopes = slope.mul_add(slope, slopes);
                }
                let means = u.mul_add(u, v * v);
                let misfit = slopes.neg_mul_add(variance, V::load(&square[x..]) - means);
                misfit.max(V::constant(MIN_MISFIT)).store(&mut square[x..]);
            }
        }
    }
}

/// Single fits of the window `scale` to `from` (planes of [`FLOW`]) to `out`, planes of [`FIT`].
pub(super) fn fits<T: SimdReal>(simd: Level, from: &Field<T>, scale: &Scale<T>, out: &mut Field<T>) {
    let len = out.row_len();
    for_each_band(out.rows_mut(), len, |_, rows, out| dispatch(simd, Fits { from, scale, rows, out }));
    out.extend(0..2, Continuation::Odd, RIM);
    out.extend(2..FIT, Continuation::Even, RIM);
}

struct Halve<'a, T> {
    from: &'a Field<T>,
    taps: &'a Taps<T>,
    rows: Range<usize>,
    out: &'a mut [T],
    stride: usize,
    width: usize,
}

impl<T: SimdReal> Kernel<T> for Halve<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { from, taps, rows, out, stride, width } = self;
        let mut buffer = vec![T::from_f64(0.0); 2 * from.stride()];
        for (y, out) in rows.zip(out.chunks_exact_mut(FLOW * stride)) {
            for k in 0..FLOW {
                smooth_row::<V>(from, k, 2 * y, taps, &mut buffer);
                pick(&buffer[from.stride()..], 2, &mut out[k * stride + LEFT..][..width]);
            }
            // The variance that smoothing removed, stored as such so that it can be mirrored.
            let (flow, square) = out.split_at_mut(2 * stride);
            for (x, s) in square[LEFT..LEFT + width].iter_mut().enumerate() {
                let (u, v) = (flow[LEFT + x], flow[stride + LEFT + x]);
                *s = *s - u * u - v * v;
            }
        }
    }
}

/// Plane `k` along row `y`, smoothed: from the second line of `buffer` on, without unused samples before it.
#[inline(always)]
pub(super) fn smooth_row<V: Lanes>(
    from: &Field<V::Scalar>,
    k: usize,
    y: usize,
    taps: &Taps<V::Scalar>,
    buffer: &mut [V::Scalar],
) {
    let (stride, taps) = (from.stride(), taps.taps.as_slice());
    let (down, along) = buffer.split_at_mut(stride);
    filter::<V, 1>(from.data(), from.start(k, y as isize), from.row_len(), stride, taps, [&mut *down]);
    filter::<V, 1>(down, LEFT, 1, from.padded(), taps, [along]);
}

#[inline(always)]
pub(super) fn pick<T: Copy>(from: &[T], step: usize, out: &mut [T]) {
    if step == 2 {
        for (o, pair) in out.iter_mut().zip(from.chunks_exact(2)) {
            *o = pair[0];
        }
    } else {
        for (o, value) in out.iter_mut().zip(from.iter().step_by(step)) {
            *o = *value;
        }
    }
}

/// The next coarser grid: planes of [`FLOW`], ready to be fitted.
pub(super) fn halve<T: SimdReal>(simd: Level, space: &PlanePool<T>, from: &Field<T>, taps: &Taps<T>) -> Field<T> {
    let (width, height) = (from.width.div_ceil(2), from.height.div_ceil(2));
    let mut out = Field::make(space, width, height, FLOW);
    let (len, stride) = (out.row_len(), out.stride());
    for_each_band(out.rows_mut(), len, |_, rows, out| {
        dispatch(simd, Halve { from, taps, rows, out, stride, width });
    });
    finish(&mut out);
    out
}

/// Extends a flow beyond the frame and completes its third plane, the variance smoothed away.
pub(super) fn finish<T: SimdReal>(flow: &mut Field<T>) {
    flow.extend(0..2, Continuation::Odd, RIM);
    flow.extend(2..3, Continuation::Even, RIM);
    let (len, stride) = (flow.row_len(), flow.stride());
    for row in flow.data_mut().chunks_exact_mut(len) {
        let (flow, square) = row.split_at_mut(2 * stride);
        let (u, v) = flow.split_at(stride);
        for ((s, u), v) in square.iter_mut().zip(u).zip(v) {
            *s = *s + *u * *u + *v * *v;
        }
    }
}

struct Samples<'a, T> {
    fits: &'a Field<T>,
    again: &'a [Taps<T>; EXTRA_PASSES],
    step: usize,
    rows: Range<usize>,
    out: &'a mut [T],
    stride: usize,
    width: usize,
}

impl<T: SimdReal> Kernel<T> for Samples<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { fits, again, step, rows, out, stride, width } = self;
        let (line, [first, further @ ..]) = (fits.stride(), TERMS.map(T::from_f64));
        let (mut sum, mut buffer) = (vec![first; line], vec![first; 2 * line]);
        for (y, out) in rows.zip(out.chunks_exact_mut(2 * stride)) {
            for k in 0..2 {
                let once = &fits.line(k, (step * y) as isize)[LEFT..];
                sum.iter_mut().zip(once).for_each(|(s, once)| *s = first * *once);
                for (taps, factor) in again.iter().zip(further) {
                    smooth_row::<V>(fits, k, step * y, taps, &mut buffer);
                    sum.iter_mut().zip(&buffer[line..]).for_each(|(s, b)| *s += factor * *b);
                }
                pick(&sum, step, &mut out[k * stride + LEFT..][..width]);
            }
        }
    }
}

/// u and v of `1 - (1 - K)^4` at every `step`-th site to the two planes of `out`.
pub(super) fn samples<T: SimdReal>(simd: Level, fits: &Field<T>, scale: &Scale<T>, step: usize, out: &mut Field<T>) {
    let (len, stride, width, again) = (out.row_len(), out.stride(), out.width, &scale.again);
    for_each_band(out.rows_mut(), len, |_, rows, out| {
        dispatch(simd, Samples { fits, again, step, rows, out, stride, width });
    });
}
