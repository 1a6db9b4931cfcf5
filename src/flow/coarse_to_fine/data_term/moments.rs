//! Windowed moments of the products: the normal equations of every site.
//!
//! For the unknowns `(u, v, u_x, v_x, u_y, v_y)` of a site, number `2 k + c` with `k` the power (1, x, y)
//! that they are multiplied by and `c` the component, the normal matrix and the right side are
//!
//! ```text
//! N[(k, c), (l, d)] = sum over the window of g x_k x_l P_cd
//! n[(k, c)]         = sum over the window of g x_k q_c
//! P_uu = w (A_x^2 + G (A_xx^2 + A_xy^2))          q_u = w (A_x b_1 + G (A_xx b_2 + A_xy b_3))
//! P_uv = w (A_x A_y + G (A_xx A_xy + A_xy A_yy))  q_v = w (A_y b_1 + G (A_xy b_2 + A_yy b_3))
//! P_vv = w (A_y^2 + G (A_xy^2 + A_yy^2))          e   = w (R^2 + G (R_x^2 + R_y^2))
//! ```
//!
//! with `x_0, x_1, x_2 = 1, x, y` px from the site, `g` the window (sum 1), `G` the squared weight of the
//! gradient rows and `w` between 0 (not usable) and 1. [`normal`] and [`right`] name the planes.

use super::{scratch::CHUNK, scratch::Columns, scratch::LEFT, scratch::PRODUCTS};
use crate::flow::coarse_to_fine::plane_pool::PlanePool;
use crate::flow::coarse_to_fine::planes::{self, Planes};
use crate::parallel::for_each_band;
use crate::simd::{Lanes, SimdReal};

pub(in super::super) const COUNT: usize = 26;
/// First plane of the right sides, after moments (1, x, y, x^2, xy, y^2) of `P_uu`, `P_uv`, `P_vv`.
const RIGHT: usize = 18;
/// Plane of the window's mean of `e`.
pub(in super::super) const ERROR: usize = 24;
/// Plane of the window's share of usable pixels.
pub(in super::super) const VALID: usize = 25;
/// Which of the moments (1, x, y, x^2, xy, y^2) belongs to two of the powers (1, x, y).
const POWER: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// Plane of the normal matrix's entry for the unknowns `i` and `j` (0 .. 6).
pub(in super::super) const fn normal(i: usize, j: usize) -> usize {
    6 * (i % 2 + j % 2) + POWER[i / 2][j / 2]
}

/// Plane of the right side's entry for the unknown `i` (0 .. 6).
pub(in super::super) const fn right(i: usize) -> usize {
    RIGHT + 3 * (i % 2) + i / 2
}

/// Planes of the window's means of `P_uu`, `P_uv` and `P_vv`, grey^2/px^2.
pub(in super::super) const UU: usize = 0;
pub(in super::super) const UV: usize = 1;
pub(in super::super) const VV: usize = 2;
/// Plane of the residual energy, grey^2.
pub(in super::super) const ENERGY: usize = 3;
/// Share of the window that is usable.
pub(in super::super) const SEEN: usize = 4;
pub(in super::super) const SUMMARY: usize = 5;
/// Planes of means, in the order of the products, of which the last one (validity) is left out.
pub(in super::super) const MEANS: usize = PRODUCTS - 1;

/// Summary of a data term for later stages: all its planes would be most of an estimate's memory.
pub(in super::super) fn summary<T: SimdReal>(space: &PlanePool<T>, data: &Planes<T>) -> Planes<T> {
    let mut out = space.planes(data.width, data.height, SUMMARY);
    let pairs = [(UU, normal(0, 0)), (UV, normal(0, 1)), (VV, normal(1, 1)), (ENERGY, ERROR), (SEEN, VALID)];
    let (stride, len) = (out.stride(), out.row_len());
    for_each_band(out.data_mut(), len, |_, rows, out| {
        for (y, out) in rows.zip(out.chunks_exact_mut(len)) {
            for (to, from) in pairs {
                out[to * stride + planes::LEFT..][..data.width].copy_from_slice(data.line(from, y));
            }
        }
    });
    out
}

/// The filters of one axis at distance 0, 1, ...: `[g, g k, g k^2]` of the Gaussian of `sigma` px.
pub(super) fn taps<T: SimdReal>(sigma: f64) -> Vec<[T; 3]> {
    // The margins of the rows do not hold a wider window.
    let radius = ((3.0 * sigma + 0.5) as usize).min(2 * LEFT - 2);
    let raw: Vec<f64> = (0..=radius).map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp()).collect();
    let sum = raw[0] + 2.0 * raw[1..].iter().sum::<f64>();
    raw.iter().enumerate().map(|(k, g)| [0, 1, 2].map(|p| T::from_f64(g / sum * (k as f64).powi(p)))).collect()
}

/// Filters down the columns: `source(-r ..= r)` are rows of a plane, `out` planes by `g`, `y g`, `y^2 g`.
#[inline(always)]
pub(super) fn vertical<V: Lanes, const N: usize>(
    columns: &Columns,
    ring: &[V::Scalar],
    starts: &[usize],
    taps: &[[V::Scalar; 3]],
    out: &mut [V::Scalar],
) {
    // Enough sums in flight to hide the latency of an addition, few enough to stay in registers.
    if N == 3 || V::LANES > 8 {
        vertical_unrolled::<V, N, 2>(columns, ring, starts, taps, out);
    } else {
        vertical_unrolled::<V, N, 4>(columns, ring, starts, taps, out);
    }
}

#[inline(always)]
fn vertical_unrolled<V: Lanes, const N: usize, const U: usize>(
    columns: &Columns,
    ring: &[V::Scalar],
    starts: &[usize],
    taps: &[[V::Scalar; 3]],
    out: &mut [V::Scalar],
) {
    let radius = taps.len() - 1;
    for h in 0..2 {
        let base = h * columns.half + LEFT;
        let mut at = 0;
        while at < columns.count {
            let mut sums = [[V::zero(); U]; N];
            let here = cut::<V, U>(ring, starts[radius] + base + at);
            for u in 0..U {
                sums[0][u] = V::load(&here[u * V::LANES..]) * V::splat(taps[0][0]);
            }
            for (k, tap) in taps.iter().enumerate().skip(1) {
                let before = cut::<V, U>(ring, starts[radius - k] + base + at);
                let after = cut::<V, U>(ring, starts[radius + k] + base + at);
                add_pair::<V, N, U>(before, after, tap, &mut sums);
            }
            for (n, sum) in sums.iter().enumerate() {
                let start = columns.row(n) + base + at;
                let target = &mut out[start..start + U * V::LANES];
                for u in 0..U {
                    sum[u].store(&mut target[u * V::LANES..]);
                }
            }
            at += U * V::LANES;
        }
    }
}

/// Filters along the row at the sites only: `source` is one plane's row, `out` the output row, where `N`
/// planes start at `places`: with `g`, `x g`, `x^2 g`.
#[inline(always)]
pub(super) fn horizontal<V: Lanes, const N: usize>(
    columns: &Columns,
    source: &[V::Scalar],
    taps: &[[V::Scalar; 3]],
    out: &mut [V::Scalar],
    places: [usize; N],
) {
    if N == 3 || V::LANES > 8 {
        horizontal_unrolled::<V, N, 2>(columns, source, taps, out, places);
    } else {
        horizontal_unrolled::<V, N, 4>(columns, source, taps, out, places);
    }
}

#[inline(always)]
fn horizontal_unrolled<V: Lanes, const N: usize, const U: usize>(
    columns: &Columns,
    source: &[V::Scalar],
    taps: &[[V::Scalar; 3]],
    out: &mut [V::Scalar],
    places: [usize; N],
) {
    let even = LEFT + columns.from - columns.first;
    let odd = columns.half + even;
    let len = (columns.to - columns.from).next_multiple_of(CHUNK);
    let mut at = 0;
    while at < len {
        let mut sums = [[V::zero(); U]; N];
        let here = cut::<V, U>(source, even + at);
        for u in 0..U {
            sums[0][u] = V::load(&here[u * V::LANES..]) * V::splat(taps[0][0]);
        }
        for (k, tap) in taps.iter().enumerate().skip(1) {
            // Column 2 X - k and 2 X + k, in the half of even or of odd columns.
            let (before, after) =
                if k % 2 == 0 { (even - k / 2, even + k / 2) } else { (odd - k / 2 - 1, odd + k / 2) };
            add_pair::<V, N, U>(cut::<V, U>(source, before + at), cut::<V, U>(source, after + at), tap, &mut sums);
        }
        for (place, sum) in places.iter().zip(&sums) {
            let target = &mut out[place + at..place + at + U * V::LANES];
            for u in 0..U {
                sum[u].store(&mut target[u * V::LANES..]);
            }
        }
        at += U * V::LANES;
    }
}

/// `U` vectors from `start` on: of known length, so that one check serves all loads.
#[inline(always)]
fn cut<V: Lanes, const U: usize>(source: &[V::Scalar], start: usize) -> &[V::Scalar] {
    &source[start..start + U * V::LANES]
}

#[inline(always)]
fn add_pair<V: Lanes, const N: usize, const U: usize>(
    before: &[V::Scalar],
    after: &[V::Scalar],
    tap: &[V::Scalar; 3],
    sums: &mut [[V; U]; N],
) {
    for u in 0..U {
        let (a, b) = (V::load(&before[u * V::LANES..]), V::load(&after[u * V::LANES..]));
        let sum = a + b;
        sums[0][u] = sum.mul_add(V::splat(tap[0]), sums[0][u]);
        if N > 1 {
            sums[1][u] = (b - a).mul_add(V::splat(tap[1]), sums[1][u]);
        }
        if N > 2 {
            sums[2][u] = sum.mul_add(V::splat(tap[2]), sums[2][u]);
        }
    }
}
