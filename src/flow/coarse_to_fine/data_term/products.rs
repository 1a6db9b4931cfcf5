//! Contributions of one pixel's equations to the normal equations.

use super::{scratch::Columns, scratch::IMAGE, scratch::LEFT, scratch::PRODUCTS};
use crate::simd::{Lanes, SimdReal};

/// Cubic B-spline stencils down the columns: value b = [1, 4, 1]/6, slope d = [-1, 0, 1]/2, curvature s = [1,
/// -2, 1] of `A`, value and slope of `R`.
/// `rows`: the image rows above, at and below; `out`: a row of the five planes.
#[inline(always)]
pub(super) fn vertical_stencils<V: Lanes>(columns: &Columns, rows: [&[V::Scalar]; 3], out: &mut [V::Scalar]) {
    let n = columns.count;
    for h in 0..2 {
        let [a0, a1, a2] = rows.map(|row| &row[columns.samples(0, h)][..n]);
        let [r0, r1, r2] = rows.map(|row| &row[columns.samples(1, h)][..n]);
        let (ab, rest) = out.split_at_mut(columns.row(1));
        let (ad, rest) = rest.split_at_mut(columns.row(1));
        let (as_, rest) = rest.split_at_mut(columns.row(1));
        let (rb, rd) = rest.split_at_mut(columns.row(1));
        let [ab, ad, as_, rb, rd] = [ab, ad, as_, rb, rd].map(|plane| &mut plane[columns.samples(0, h)][..n]);
        let (half, sixth) = (V::constant(0.5), V::constant(1.0 / 6.0));
        let mut at = 0;
        while at + V::LANES <= n {
            let (up, here, down) = (V::load(&a0[at..]), V::load(&a1[at..]), V::load(&a2[at..]));
            let curve = (up - here) + (down - here);
            // [1, 4, 1]/6 is the value and a sixth of [1, -2, 1].
            curve.mul_add(sixth, here).store(&mut ab[at..]);
            (half * (down - up)).store(&mut ad[at..]);
            curve.store(&mut as_[at..]);
            let (up, here, down) = (V::load(&r0[at..]), V::load(&r1[at..]), V::load(&r2[at..]));
            let curve = (up - here) + (down - here);
            curve.mul_add(sixth, here).store(&mut rb[at..]);
            (half * (down - up)).store(&mut rd[at..]);
            at += V::LANES;
        }
    }
}

/// Value, slope and curvature along x from three neighbours.
#[inline(always)]
fn along<V: Lanes>([left, here, right]: [V; 3]) -> [V; 3] {
    let curve = (left - here) + (right - here);
    [curve.mul_add(V::constant(1.0 / 6.0), here), V::constant(0.5) * (right - left), curve]
}

#[derive(Clone, Copy)]
pub(super) struct Weights<V> {
    /// Square of the gradient rows' weight.
    pub gradient: V,
    /// 1 / (c s), the inverse of the `R` at which a pixel has weight 1/2; 0: all have weight 1.
    pub inverse: V,
    /// 1: the right sides hold the motion; 0: they do not.
    pub motion: V,
}

#[inline(always)]
pub(super) fn products_row<T: SimdReal, V: Lanes<Scalar = T>>(
    columns: &Columns,
    weights: Weights<V>,
    stencil: &[T],
    image: &[T],
    out: &mut [T],
) {
    let n = columns.count;
    // Each half's left and right neighbours are in the other half.
    let planes: [[&[T]; 4]; 5] = std::array::from_fn(|k| {
        let row = &stencil[columns.row(k)..columns.row(k + 1)];
        let (even, odd) = (LEFT, columns.half + LEFT);
        [even, even + 1, odd - 1, odd].map(|start| &row[start..start + n])
    });
    let motion: [[&[T]; 3]; 2] =
        std::array::from_fn(|h| [2, 3, 4].map(|k| &image[..columns.row(IMAGE)][columns.samples(k, h)][..n]));
    let places = places(columns, out);
    let mut at = 0;
    while at + V::LANES <= n {
        let mut near = [[[V::zero(); 3]; 5]; 2];
        for k in 0..5 {
            let [even, next, before, odd] = planes[k];
            let (even, odd) = (V::load(&even[at..]), V::load(&odd[at..]));
            near[0][k] = [V::load(&before[at..]), even, odd];
            near[1][k] = [even, odd, V::load(&next[at..])];
        }
        for h in 0..2 {
            let [u, v, valid] = motion[h];
            let here = [V::load(&u[at..]), V::load(&v[at..]), V::load(&valid[at..])];
            let seven = products(near[h], here, weights);
            for k in 0..PRODUCTS {
                seven[k].store(&mut places[k][h][at..]);
            }
        }
        at += V::LANES;
    }
}

#[inline(always)]
fn places<'a, T>(columns: &Columns, row: &'a mut [T]) -> [[&'a mut [T]; 2]; PRODUCTS] {
    let mut rest = row;
    std::array::from_fn(|_| {
        std::array::from_fn(|_| {
            let (half, after) = std::mem::take(&mut rest).split_at_mut(columns.half);
            rest = after;
            &mut half[LEFT..LEFT + columns.count]
        })
    })
}

/// `P_uu, P_uv, P_vv, q_u, q_v, e` and validity of some pixels, from the stencils left, here and right.
#[inline(always)]
fn products<V: Lanes>(near: [[V; 3]; 5], [u, v, valid]: [V; 3], weights: Weights<V>) -> [V; PRODUCTS] {
    let [_, ax, axx] = along(near[0]);
    let [ay, axy, _] = along(near[1]);
    let [ayy, _, _] = along(near[2]);
    let [r, rx, _] = along(near[3]);
    let [ry, _, _] = along(near[4]);
    // Unusable pixels may hold any value: it must not enter as 0 times infinity.
    let seen = V::zero().lt(valid);
    let [u, v] = [u, v].map(|flow| V::select(seen, flow, V::zero()) * weights.motion);
    let b1 = ax.mul_add(u, ay.mul_add(v, -r));
    let b2 = axx.mul_add(u, axy.mul_add(v, -rx));
    let b3 = axy.mul_add(u, ayy.mul_add(v, -ry));
    let deviation = r * weights.inverse;
    let w = valid / deviation.mul_add(deviation, V::constant(1.0));
    let wg = w * weights.gradient;
    let (wax, way, waxx, waxy, wayy) = (w * ax, w * ay, wg * axx, wg * axy, wg * ayy);
    [
        wax.mul_add(ax, waxx.mul_add(axx, waxy * axy)),
        wax.mul_add(ay, waxx.mul_add(axy, waxy * ayy)),
        way.mul_add(ay, waxy.mul_add(axy, wayy * ayy)),
        wax.mul_add(b1, waxx.mul_add(b2, waxy * b3)),
        way.mul_add(b1, waxy.mul_add(b2, wayy * b3)),
        (w * r).mul_add(r, wg * rx.mul_add(rx, ry * ry)),
        valid,
    ]
}

/// Adds `|R|` at every fourth column of `from..to` where the pixel is usable.
#[inline(always)]
pub(super) fn residuals<T: SimdReal>(columns: &Columns, stencil: &[T], image: &[T], out: &mut Vec<T>) {
    let (even, odd) = (columns.row(3) + LEFT, columns.row(3) + columns.half + LEFT);
    let valid = columns.samples(4, 0).start;
    for site in (columns.from.next_multiple_of(2)..columns.to).step_by(2) {
        let i = site - columns.first;
        if image[valid + i] > T::from_f64(0.0) {
            let (here, beside) = (stencil[even + i], stencil[odd + i - 1] + stencil[odd + i]);
            let r = here * T::from_f64(4.0 / 6.0) + beside * T::from_f64(1.0 / 6.0);
            out.push(if r < T::from_f64(0.0) { -r } else { r });
        }
    }
}
