//! The equations of one pixel, `i' + P(i) m = 0` and `i'' + P(i') m = 0`, and the products that windows sum.
//!
//! `P = -J` is linear in the jet. Unknowns are scaled to `(u, v, s u_x, s v_x, s u_y, s v_y)`, s the window's
//! sigma, so that all columns are of one order.

use super::{plan::MAX_PLANES, plan::Plan};
use crate::simd::Lanes;

/// Rows in which the columns of the flow, of its derivatives along x and along y are not zero.
const ROWS_OF: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// The matrix `P(jet)`: for each unknown its column, zero beyond the first `ROWS` rows.
#[inline(always)]
pub(super) fn columns<V: Lanes, const ROWS: usize>(jet: &[V; 6]) -> [[V; 6]; 6] {
    let [_, x, y, xx, xy, yy] = *jet;
    let values = [[x, xx, xy], [y, xy, yy], [x, xx + xx, xy], [y, xy + xy, yy], [x, xx, xy + xy], [y, xy, yy + yy]];
    let mut columns = [[V::zero(); 6]; 6];
    for (a, (column, values)) in columns.iter_mut().zip(values).enumerate() {
        for (row, value) in ROWS_OF[a / 2].into_iter().zip(values) {
            if row < ROWS {
                column[row] = value;
            }
        }
    }
    columns
}

/// Weights of the jet's components in `c . (P(jet) m)`, for weights `c` of the rows.
#[inline(always)]
pub(super) fn pulled_back<V: Lanes>(c: &[V; 6], m: &[V; 6]) -> [V; 6] {
    let [u, v, u_x, v_x, u_y, v_y] = *m;
    let twice = |a: V| a + a;
    [
        V::zero(),
        c[0].mul_add(u, c[1].mul_add(u_x, c[2] * u_y)),
        c[0].mul_add(v, c[1].mul_add(v_x, c[2] * v_y)),
        c[1].mul_add(u, twice(c[3]).mul_add(u_x, c[4] * u_y)),
        c[1].mul_add(v, c[2].mul_add(u, twice(c[3]).mul_add(v_x, c[4].mul_add(u_x + v_y, twice(c[5]) * u_y)))),
        c[2].mul_add(v, c[4].mul_add(v_x, twice(c[5]) * v_y)),
    ]
}

/// The jets of the coefficient frame and of the first and second time difference at one pixel.
#[derive(Clone, Copy)]
pub(super) struct Jets<V> {
    pub coefficient: [V; 6],
    pub first: [V; 6],
    pub second: [V; 6],
}

/// The planes of one pixel for `ROWS` = 1, 3, 6 or 12 rows: `P^T P`, minus `P^T` times the rates, the squared
/// rates, `usable` and the squared brightness. `scale` is 1 / s. The rate of `carried`, a motion that the
/// images lack, is put back.
#[inline(always)]
pub(super) fn products<V: Lanes, const ROWS: usize>(
    jets: &Jets<V>,
    (usable, scale): (V, V),
    carried: Option<&[V; 6]>,
) -> [V; MAX_PLANES] {
    let plan = Plan::of_rows(ROWS);
    let mut planes = [V::zero(); MAX_PLANES];
    let blocks = [(&jets.coefficient, &jets.first), (&jets.first, &jets.second)];
    for (jet, rate) in blocks.into_iter().take(if ROWS == 12 { 2 } else { 1 }) {
        let mut p = columns::<V, ROWS>(jet);
        let mut rate = *rate;
        if let Some(motion) = carried {
            for (k, rate) in rate.iter_mut().enumerate() {
                *rate = p.iter().zip(motion).fold(*rate, |rate, (column, m)| column[k].neg_mul_add(*m, rate));
            }
        }
        for column in &mut p[2..] {
            *column = column.map(|value| value * scale);
        }
        for i in 0..plan.columns {
            for j in i..plan.columns {
                // The products of v with u_x, v_x are those of u with u_y, v_y.
                let repeated = i == 1 && (j == 2 || j == 3) || i >= 4 && ROWS == 3;
                let Some(place) = plan.place(i, j).filter(|_| !repeated) else { continue };
                let sum = &mut planes[place];
                for k in ROWS_OF[i / 2] {
                    if k < ROWS && ROWS_OF[j / 2].contains(&k) {
                        *sum = p[i][k].mul_add(p[j][k], *sum);
                    }
                }
            }
            let sum = &mut planes[plan.right(i)];
            for k in ROWS_OF[i / 2] {
                if k < ROWS {
                    *sum = p[i][k].neg_mul_add(rate[k], *sum);
                }
            }
        }
        for rate in &rate[..ROWS.min(6)] {
            planes[plan.energy()] = rate.mul_add(*rate, planes[plan.energy()]);
        }
    }
    planes[plan.weight()] = usable;
    planes[plan.brightness()] = jets.coefficient[0] * jets.coefficient[0];
    planes
}
