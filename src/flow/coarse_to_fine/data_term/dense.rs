//! Motion at every pixel: between sites, parabolas with the values of both and the change of their slopes.

use super::{scratch::Columns, scratch::LEFT};
use crate::flow::coarse_to_fine::{planes::LEFT as GRID_LEFT, planes::Planes};
use crate::simd::Lanes;

/// Motion at the pixels of row `y`, in the halves of `u` and of `v`.
#[inline(always)]
pub(super) fn dense_row<V: Lanes>(
    motion: &Planes<V::Scalar>,
    y: usize,
    columns: &Columns,
    sites: &mut [V::Scalar],
    uv: &mut [V::Scalar],
) {
    for c in 0..2 {
        let (value, slope) = sites[2 * c * columns.half..2 * (c + 1) * columns.half].split_at_mut(columns.half);
        site_row::<V>(motion, c, y, columns, value, slope);
        let (even, odd) = uv[columns.row(c)..columns.row(c + 1)].split_at_mut(columns.half);
        widen::<V>(columns.count, value, slope, even, odd);
    }
}

/// Component `c` and its slope along x on row `y` of pixels at the sites, and one site beyond the last.
#[inline(always)]
fn site_row<V: Lanes>(
    motion: &Planes<V::Scalar>,
    c: usize,
    y: usize,
    columns: &Columns,
    value: &mut [V::Scalar],
    slope: &mut [V::Scalar],
) {
    let n = columns.count;
    let planes = |row: usize| {
        let row = motion.row(row);
        [c, c + 2, c + 4].map(|k| {
            let start = k * motion.stride() + GRID_LEFT + columns.first;
            &row[start..start + n]
        })
    };
    let [u, ux, uy] = planes(y / 2);
    let (to, along) = (&mut value[LEFT..LEFT + n], &mut slope[LEFT..LEFT + n]);
    if y.is_multiple_of(2) {
        to.copy_from_slice(u);
        along.copy_from_slice(ux);
    } else if y / 2 + 1 < motion.height {
        let [u2, ux2, uy2] = planes(y / 2 + 1);
        let (half, quarter) = (V::constant(0.5), V::constant(0.25));
        let mut at = 0;
        while at + V::LANES <= n {
            let (sum, turn) = (V::load(&u[at..]) + V::load(&u2[at..]), V::load(&uy[at..]) - V::load(&uy2[at..]));
            quarter.mul_add(turn, half * sum).store(&mut to[at..]);
            (half * (V::load(&ux[at..]) + V::load(&ux2[at..]))).store(&mut along[at..]);
            at += V::LANES;
        }
    } else {
        let mut at = 0;
        while at + V::LANES <= n {
            (V::load(&u[at..]) + V::load(&uy[at..])).store(&mut to[at..]);
            at += V::LANES;
        }
        along.copy_from_slice(ux);
    }
    // The site beyond the last is extrapolated.
    let end = motion.width - columns.first;
    if end <= n {
        let last = LEFT + end - 1;
        slope[last + 1] = slope[last];
        value[last + 1] = value[last] + slope[last] + slope[last];
    }
}

/// Even columns are the sites, odd ones lie halfway between two.
#[inline(always)]
fn widen<V: Lanes>(n: usize, value: &[V::Scalar], slope: &[V::Scalar], even: &mut [V::Scalar], odd: &mut [V::Scalar]) {
    let (u, ux) = (&value[LEFT..LEFT + n], &slope[LEFT..LEFT + n]);
    let (next, next_slope) = (&value[LEFT + 1..=LEFT + n], &slope[LEFT + 1..=LEFT + n]);
    let (even, odd) = (&mut even[LEFT..LEFT + n], &mut odd[LEFT..LEFT + n]);
    let (half, quarter) = (V::constant(0.5), V::constant(0.25));
    let mut at = 0;
    while at + V::LANES <= n {
        let here = V::load(&u[at..]);
        here.store(&mut even[at..]);
        let turn = V::load(&ux[at..]) - V::load(&next_slope[at..]);
        quarter.mul_add(turn, half * (here + V::load(&next[at..]))).store(&mut odd[at..]);
        at += V::LANES;
    }
}
