//! Motion between sites, on the next level, at other pixels (`rows`), and at the `first_frame` of a pair.

pub(super) mod first_frame;
pub(super) mod rows;

use super::{data_term::MOTION, planes::LEFT, planes::Planes};
use crate::parallel;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use rows::RowReader;

const ROWS: usize = 32;

/// Affine motions of the sites around a position, each with half its lever, blended by distance.
///
/// `(x, y)`: px of the level whose sites are `step` px apart; beyond the last site its model is extrapolated.
pub(super) fn motion_at<T: SimdReal>(motion: &Planes<T>, step: f64, x: f64, y: f64) -> [f64; MOTION] {
    let split = |at: f64, count: usize| {
        let site = (at / step).clamp(0.0, (count - 1) as f64);
        let first = (site as usize).min(count.saturating_sub(2));
        let share = site - first as f64;
        (first, share, 0.5 * share * step + (at - site * step))
    };
    let ((i, fx, lever_x), (j, fy, lever_y)) = (split(x, motion.width), split(y, motion.height));
    let stride = motion.stride();
    let mut blend = [0.0; MOTION];
    for (row, weight_y, dy) in [(j, 1.0 - fy, lever_y), (j + 1, fy, lever_y - 0.5 * step)] {
        if weight_y == 0.0 {
            continue;
        }
        let values = &motion.row(row)[LEFT..];
        for (column, weight_x, dx) in [(i, 1.0 - fx, lever_x), (i + 1, fx, lever_x - 0.5 * step)] {
            let m: [f64; MOTION] = std::array::from_fn(|k| values[k * stride + column].to_f64());
            let weight = weight_x * weight_y;
            blend[0] += weight * (m[0] + m[2] * dx + m[4] * dy);
            blend[1] += weight * (m[1] + m[3] * dx + m[5] * dy);
            for k in 2..MOTION {
                blend[k] += weight * m[k];
            }
        }
    }
    blend
}

/// Motion on the sites of the level twice as fine, of `size` pixels: flow doubles.
///
/// The fine level's site `(x, y)` is its pixel `(2 x, 2 y)`, which is the coarse level's pixel `(x, y)`.
pub(super) fn finer<T: SimdReal>(simd: Level, coarse: &Planes<T>, size: (usize, usize), fine: &mut Planes<T>) {
    fine.reshape(size.0.div_ceil(2), size.1.div_ceil(2), MOTION);
    let (width, stride, len) = (fine.width, fine.stride(), fine.row_len().max(1));
    parallel::for_each(fine.data_mut().chunks_mut(ROWS * len).enumerate(), |(task, out)| {
        dispatch(simd, Finer { coarse, first: task * ROWS, out, len, stride, width });
    });
}

struct Finer<'a, T> {
    coarse: &'a Planes<T>,
    first: usize,
    out: &'a mut [T],
    len: usize,
    stride: usize,
    width: usize,
}

impl<T: SimdReal> Kernel<T> for Finer<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { coarse, first, out, len, stride, width } = self;
        let two = T::from_f64(2.0);
        let mut reader = RowReader::new(width);
        for (y, row) in (first..).zip(out.chunks_mut(len)) {
            reader.read_motion(coarse, y);
            for k in 0..MOTION {
                let target = &mut row[k * stride + LEFT..][..width];
                target.copy_from_slice(reader.plane(k));
                if k < 2 {
                    for value in target {
                        *value *= two;
                    }
                }
            }
        }
    }
}

/// The inverse of [`finer`], to `size` sites: every second site, flow halved.
pub(super) fn coarser<T: SimdReal>(fine: &Planes<T>, size: (usize, usize), coarse: &mut Planes<T>) {
    coarse.reshape(size.0, size.1, MOTION);
    for (k, y) in (0..MOTION).flat_map(|k| (0..size.1).map(move |y| (k, y))) {
        let factor = T::from_f64(if k < 2 { 0.5 } else { 1.0 });
        let sites = fine.line(k, 2 * y).iter().step_by(2);
        coarse.line_mut(k, y).iter_mut().zip(sites).for_each(|(to, from)| *to = factor * *from);
    }
}

/// The same flow, with the Jacobian recomputed from it: the central difference over two pixels of the blended
/// affine models. Border sites keep their Jacobian across the border.
///
/// Relaxation stops long before it converges, with the Jacobian behind the flow; this lets it catch up.
pub(super) fn rederive<T: SimdReal>(old: &Planes<T>, out: &mut Planes<T>) {
    out.reshape(old.width, old.height, old.count);
    let (stride, len, width) = (out.stride(), out.row_len().max(1), old.width);
    parallel::for_each(out.data_mut().chunks_mut(ROWS * len).enumerate(), |(task, rows)| {
        for (y, row) in (task * ROWS..).zip(rows.chunks_mut(len)) {
            row[..2 * stride].copy_from_slice(&old.row(y)[..2 * stride]);
            for k in 0..2 {
                let along_x = &mut row[(2 + k) * stride + LEFT..][..width];
                slopes_along(old.line(k, y), old.line(2 + k, y), along_x);
                let along_y = &mut row[(4 + k) * stride + LEFT..][..width];
                if y > 0 && y + 1 < old.height {
                    slopes_across([y - 1, y, y + 1].map(|y| (old.line(k, y), old.line(4 + k, y))), along_y);
                } else {
                    along_y.copy_from_slice(old.line(4 + k, y));
                }
            }
        }
    });
}

/// Slopes between the sites of a row; the first and the last are kept.
fn slopes_along<T: SimdReal>(flow: &[T], slope: &[T], out: &mut [T]) {
    for end in [0, out.len() - 1] {
        out[end] = slope[end];
    }
    let inner = out.len().saturating_sub(2);
    let (before, here, after) = (&slope[..inner], &slope[1.min(slope.len())..], &slope[2.min(slope.len())..]);
    let quarter = T::from_f64(0.25);
    for (x, out) in out.iter_mut().skip(1).take(inner).enumerate() {
        *out = quarter * ((flow[x + 2] - flow[x]) + (here[x] - before[x]) + (here[x] - after[x]));
    }
}

/// Slopes at the sites of a row from flow and slopes of the rows above, here and below.
fn slopes_across<T: SimdReal>([above, here, below]: [(&[T], &[T]); 3], out: &mut [T]) {
    let quarter = T::from_f64(0.25);
    for (x, out) in out.iter_mut().enumerate() {
        *out = quarter * ((below.0[x] - above.0[x]) + (here.1[x] - above.1[x]) + (here.1[x] - below.1[x]));
    }
}
