//! Interpolation from coarse sites to fine ones.

use super::{choose::Choice, ladder::MAX_OCTAVE};
use crate::flow::coarse_to_fine::extended::{Continuation, Field, RIM};
use crate::flow::coarse_to_fine::plane_pool::PlanePool;
use crate::flow::coarse_to_fine::planes::LEFT;
use crate::math::Real;
use crate::parallel::for_each_band;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use std::ops::Range;

/// Plane `k` of the choice along row `y` of the grid `octave`, linear, to `out`; `down` holds a line.
#[inline(always)]
pub(super) fn widen<V: Lanes>(
    choice: &Choice<V::Scalar>,
    k: usize,
    octave: usize,
    y: usize,
    down: &mut [V::Scalar],
    out: &mut [V::Scalar],
) {
    let planes = &choice.planes;
    let (stride, factor) = (planes.stride(), 1 << (MAX_OCTAVE - octave));
    let (row, below) = (y / factor, (y / factor + 1).min(planes.height - 1));
    let (from, to) = (k * stride + LEFT, (k + 1) * stride);
    let (upper, lower) = (&planes.row(row)[from..to], &planes.row(below)[from..to]);
    let share = V::constant((y % factor) as f64 / factor as f64);
    for x in (0..planes.padded()).step_by(V::LANES) {
        let (a, b) = (V::load(&upper[x..]), V::load(&lower[x..]));
        (b - a).mul_add(share, a).store(&mut down[x..]);
    }
    // One more, for interpolation beyond the last.
    down[planes.width] = down[planes.width - 1];
    match octave {
        0 => along::<V::Scalar, 4>(down, planes.width, out),
        1 => along::<V::Scalar, 2>(down, planes.width, out),
        _ => along::<V::Scalar, 1>(down, planes.width, out),
    }
}

#[inline(always)]
fn along<T: SimdReal, const F: usize>(from: &[T], width: usize, out: &mut [T]) {
    let share: [T; F] = std::array::from_fn(|p| T::from_f64(p as f64 / F as f64));
    for ((pair, next), out) in from[..width].iter().zip(&from[1..=width]).zip(out.chunks_exact_mut(F)) {
        for p in 0..F {
            out[p] = *pair + (*next - *pair) * share[p];
        }
    }
}

/// Plane `k` of a grid of every second site, by cubics to row `y` of `width` sites, to `out`.
#[inline(always)]
pub(super) fn grow_row<V: Lanes>(
    from: &Field<V::Scalar>,
    k: usize,
    y: usize,
    width: usize,
    down: &mut [V::Scalar],
    out: &mut [V::Scalar],
) {
    let (row, stride) = ((y / 2) as isize, from.stride());
    let down = &mut down[..stride];
    if y.is_multiple_of(2) {
        down.copy_from_slice(from.line(k, row));
    } else {
        let lines = [from.line(k, row - 1), from.line(k, row), from.line(k, row + 1), from.line(k, row + 2)];
        let (near, far) = (V::constant(9.0 / 16.0), V::constant(-1.0 / 16.0));
        for x in (0..stride).step_by(V::LANES) {
            let inner = V::load(&lines[1][x..]) + V::load(&lines[2][x..]);
            let outer = V::load(&lines[0][x..]) + V::load(&lines[3][x..]);
            inner.mul_add(near, outer * far).store(&mut down[x..]);
        }
    }
    let count = width.div_ceil(2);
    let near = V::Scalar::from_f64(9.0 / 16.0);
    let far = V::Scalar::from_f64(-1.0 / 16.0);
    let at = |shift: usize| &down[LEFT - 1 + shift..][..count];
    let (a, b, c, d) = (at(0), at(1), at(2), at(3));
    for (x, out) in out.chunks_exact_mut(2).take(count).enumerate() {
        out[0] = b[x];
        out[1] = (b[x] + c[x]) * near + (a[x] + d[x]) * far;
    }
}

struct Grow<'a, T> {
    from: &'a Field<T>,
    rows: Range<usize>,
    out: &'a mut [T],
    count: usize,
    stride: usize,
    width: usize,
}

impl<T: SimdReal> Kernel<T> for Grow<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { from, rows, out, count, stride, width } = self;
        let mut down = vec![T::from_f64(0.0); from.stride()];
        for (y, out) in rows.zip(out.chunks_exact_mut(count * stride)) {
            for (k, line) in out.chunks_exact_mut(stride).enumerate() {
                grow_row::<V>(from, k, y, width, &mut down, &mut line[LEFT..]);
            }
        }
    }
}

/// The first `count` planes on the next finer grid, with the sites of `like`.
pub(super) fn grow<T: SimdReal>(
    simd: Level,
    space: &PlanePool<T>,
    from: &Field<T>,
    count: usize,
    like: &Field<T>,
) -> Field<T> {
    let mut out = Field::make(space, like.width, like.height, count);
    let (len, stride, width) = (out.row_len(), out.stride(), out.width);
    for_each_band(out.rows_mut(), len, |_, rows, out| {
        dispatch(simd, Grow { from, rows, out, count, stride, width });
    });
    out.extend(0..2, Continuation::Odd, RIM);
    out.extend(2..count, Continuation::Even, RIM);
    out
}
