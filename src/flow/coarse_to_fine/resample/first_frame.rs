//! Motion of a pair, estimated midway between the frames, at the pixels of the first frame.

use crate::flow::coarse_to_fine::data_term::MOTION;
use crate::flow::coarse_to_fine::plane_pool::PlanePool;
use crate::flow::coarse_to_fine::planes::{LEFT, Planes, SITE_SPACING};
use crate::math::Real;
use crate::parallel::for_each_band;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use std::ops::Range;

/// Maximum number of lanes of a vector.
const MAX_LANES: usize = 16;
/// Minimum determinant of `I - M / 2`; below it the motion folds the image.
const MIN_DETERMINANT: f64 = 0.1;

/// Motion at the pixels of the first frame from that midway to the second.
///
/// The pixel `p` moves by `u_1(p) = u(p + u_1(p) / 2)`, since its midway position is half its own motion off.
/// The implicit equation is started from the affine model about `p` and iterated once; its derivative is `M_1
/// = (I - M / 2)^-1 M` with `M` midway.
pub(in crate::flow::coarse_to_fine) fn at_first_frame<T: SimdReal>(
    simd: Level,
    space: &PlanePool<T>,
    motion: &Planes<T>,
) -> Planes<T> {
    let mut out = space.planes(motion.width, motion.height, MOTION);
    if motion.width == 0 || motion.height == 0 {
        return out;
    }
    let (stride, len) = (out.stride(), out.row_len());
    let columns: Vec<T> = (0..motion.padded()).map(|x| T::from_f64(SITE_SPACING * x as f64)).collect();
    for_each_band(out.data_mut(), len, |_, rows, out| {
        dispatch(simd, ToFirstFrame { motion, columns: &columns, rows, out, stride });
    });
    out
}

struct ToFirstFrame<'a, T> {
    motion: &'a Planes<T>,
    /// Columns of the sites, px.
    columns: &'a [T],
    rows: Range<usize>,
    out: &'a mut [T],
    stride: usize,
}

impl<T: SimdReal> Kernel<T> for ToFirstFrame<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { motion, columns, rows, out, stride } = self;
        for (y, out) in rows.zip(out.chunks_exact_mut(MOTION * stride)) {
            let row = motion.row(y);
            for i in (0..columns.len()).step_by(V::LANES) {
                let mut m = [V::zero(); MOTION];
                for (k, m) in m.iter_mut().enumerate() {
                    *m = V::load(&row[k * stride + LEFT + i..]);
                }
                let [du, dv] = solve(&m, [m[0], m[1]]);
                let half = V::constant(0.5);
                let x = du.mul_add(half, V::load(&columns[i..]));
                let y = dv.mul_add(half, V::constant(SITE_SPACING * y as f64));
                let m = blend(motion, x, y);
                let ([u_x, v_x], [u_y, v_y]) = (solve(&m, [m[2], m[3]]), solve(&m, [m[4], m[5]]));
                for (k, value) in [m[0], m[1], u_x, v_x, u_y, v_y].into_iter().enumerate() {
                    value.store(&mut out[k * stride + LEFT + i..]);
                }
            }
        }
    }
}

/// `(I - M / 2)^-1 b`, or `b` where the motion folds the image.
#[inline(always)]
fn solve<V: Lanes>(motion: &[V; MOTION], [a, b]: [V; 2]) -> [V; 2] {
    let [_, _, u_x, v_x, u_y, v_y] = *motion;
    let (half, one) = (V::constant(0.5), V::constant(1.0));
    let (p, q) = (u_x.neg_mul_add(half, one), -(u_y * half));
    let (r, s) = (-(v_x * half), v_y.neg_mul_add(half, one));
    let determinant = q.neg_mul_add(r, p * s);
    let open = V::constant(MIN_DETERMINANT).lt(determinant);
    let inverse = one / determinant;
    let x = q.neg_mul_add(b, s * a) * inverse;
    let y = r.neg_mul_add(a, p * b) * inverse;
    [V::select(open, x, a), V::select(open, y, b)]
}

/// Position of a coordinate among `count` sites: the site before it, the lever of that site's slope (px), and
/// the weight of the next site. Beyond the last site its own model is extrapolated.
#[inline(always)]
fn split<V: Lanes>(at: V, count: usize) -> (V, V, V) {
    let site = (at * V::constant(1.0 / SITE_SPACING)).max(V::zero()).min(V::constant(count as f64 - 1.0));
    let first = site.floor().min(V::constant(count.saturating_sub(2) as f64));
    let (share, beyond) = (site - first, site.neg_mul_add(V::constant(SITE_SPACING), at));
    (first, share.mul_add(V::constant(0.5 * SITE_SPACING), beyond), share)
}

/// As [`motion_at`](super::motion_at), one position a lane.
#[inline(always)]
fn blend<V: Lanes>(motion: &Planes<V::Scalar>, x: V, y: V) -> [V; MOTION] {
    let (column, dx, share_x) = split(x, motion.width);
    let (row, dy, share_y) = split(y, motion.height);
    let (stride, len) = (motion.stride(), motion.row_len());
    let starts = starts(column, row, len);
    // A single row or column has no neighbour; its weight is zero.
    let below = if motion.height > 1 { len } else { 0 };
    let (one, half) = (V::constant(1.0), V::constant(0.5 * SITE_SPACING));
    let mut sum = [V::zero(); MOTION];
    for corner in 0..4 {
        let (right, down) = (corner % 2, corner / 2);
        let mut m = [V::zero(); MOTION];
        for (k, m) in m.iter_mut().enumerate() {
            *m = gather(motion.data(), &starts, k * stride + LEFT + right + down * below);
        }
        let (dx, weight_x) = if right == 0 { (dx, one - share_x) } else { (dx - half, share_x) };
        let (dy, weight_y) = if down == 0 { (dy, one - share_y) } else { (dy - half, share_y) };
        let weight = weight_x * weight_y;
        m[0] = m[2].mul_add(dx, m[4].mul_add(dy, m[0]));
        m[1] = m[3].mul_add(dx, m[5].mul_add(dy, m[1]));
        for k in 0..MOTION {
            sum[k] = m[k].mul_add(weight, sum[k]);
        }
    }
    sum
}

/// Index of the first sample of each lane's site.
#[inline(always)]
fn starts<V: Lanes>(column: V, row: V, len: usize) -> [usize; MAX_LANES] {
    let zero = V::Scalar::from_f64(0.0);
    let (mut columns, mut rows) = ([zero; MAX_LANES], [zero; MAX_LANES]);
    column.store(&mut columns);
    row.store(&mut rows);
    let mut starts = [0; MAX_LANES];
    for l in 0..V::LANES {
        starts[l] = rows[l].to_f64() as usize * len + columns[l].to_f64() as usize;
    }
    starts
}

/// The samples `offset` after each lane's start.
#[inline(always)]
fn gather<V: Lanes>(data: &[V::Scalar], starts: &[usize; MAX_LANES], offset: usize) -> V {
    let mut values = [V::Scalar::from_f64(0.0); MAX_LANES];
    for l in 0..V::LANES {
        values[l] = data[starts[l] + offset];
    }
    V::load(&values)
}
