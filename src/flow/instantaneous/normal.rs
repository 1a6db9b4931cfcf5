//! The affine model's normal equations in lanes, with the sparsity of (21) written out.
//!
//! With `g = (Ix, Iy)`, Hessian rows `h1, h2` and unknowns in three pairs `f = (u, v), X = (u_x, v_x), Y =
//! (u_y, v_y)`, the rows of J are `[g 0 0], [h1 g 0], [h2 0 g], [0 2h1 0], [0 h2 h1], [0 0 2h2]`, so `J^T J`
//! is made of fifteen products. It is solved by block elimination, pair by pair: three divisions, and short
//! chains between them.

use super::{blocks::Mat, blocks::Sym};
use crate::math::Real;
use crate::simd::{Lanes, SimdReal};

/// The jet and its time derivatives that the equations are made of, in lanes.
#[derive(Clone, Copy)]
pub(super) struct LaneRates<V> {
    /// `Ix, Iy, Ixx, Ixy, Iyy`.
    pub jet: [V; 5],
    /// **Minus** `i'`: with this sign the right sides need no change of sign (J enters squared or together
    /// with it).
    pub minus_first: [V; 6],
    /// `i''`.
    pub second: [V; 6],
}

/// A solution in lanes.
#[derive(Clone, Copy)]
pub(super) struct LaneSolution<V> {
    /// `u, v, u_x, v_x, u_y, v_y`.
    pub motion: [V; 6],
    /// Positive where every pivot is large enough for the precision and everything is finite; else the lane
    /// must be done again with more care.
    pub trust: V,
}

/// Smallest accepted product of two pivots over that of their columns' squared lengths, within a pair of
/// unknowns: `1 - R^2` of a column given those before it. In single precision the solution then keeps about
/// three digits in the worst accepted pixel; in double, seven.
pub(super) fn pivot_tolerance<T: Real>() -> f64 {
    if size_of::<T>() == 4 { 3e-4 } else { 1e-9 }
}

/// Squared length that rounding noise may give a column, for brightness 1.
pub(super) fn noise_square<T: Real>() -> f64 {
    let spacing = if size_of::<T>() == 4 { f64::from(f32::EPSILON) } else { f64::EPSILON };
    // Twelve entries, and eight standard deviations of margin: below this the careful path decides.
    12.0 * 64.0 * spacing * spacing
}

/// The normal equations `J^T J m = r` in blocks, as far eliminated as their solution and their inverse need.
#[derive(Clone, Copy)]
pub(super) struct Normal<V> {
    ff: Sym<V>,
    xx: Sym<V>,
    yy: Sym<V>,
    fx: Mat<V>,
    fy: Mat<V>,
    xy: Mat<V>,
    /// Inverses of the blocks that elimination leaves on the diagonal.
    ff_inverse: Sym<V>,
    xx_inverse: Sym<V>,
    yy_inverse: Sym<V>,
    /// `ff^-1 fx`, `ff^-1 fy`, and the same of what is left of xx and xy.
    wx: Mat<V>,
    wy: Mat<V>,
    wxy: Mat<V>,
    /// What they were made for.
    pub solution: LaneSolution<V>,
}

impl<V: Lanes> Normal<V> {
    /// The inverse of the normal matrix.
    #[inline(always)]
    pub fn inverse(&self) -> [[V; 6]; 6] {
        let Self { ff_inverse, xx_inverse, yy_inverse: zyy, wx, wy, wxy, .. } = *self;
        let zxy = wxy.times_symmetric(zyy).negative();
        let zxx = xx_inverse.less_product(zxy, wxy);
        let zfx = wx.times_symmetric(zxx).plus_product_transposed(wy, zxy).negative();
        let zfy = wy.times_symmetric(zyy).plus_product(wx, zxy).negative();
        let zff = ff_inverse.less_product(zfx, wx).less_product(zfy, wy);
        [
            [zff.a, zff.b, zfx.a, zfx.b, zfy.a, zfy.b],
            [zff.b, zff.c, zfx.c, zfx.d, zfy.c, zfy.d],
            [zfx.a, zfx.c, zxx.a, zxx.b, zxy.a, zxy.b],
            [zfx.b, zfx.d, zxx.b, zxx.c, zxy.c, zxy.d],
            [zfy.a, zfy.c, zxy.a, zxy.c, zyy.a, zyy.b],
            [zfy.b, zfy.d, zxy.b, zxy.d, zyy.b, zyy.c],
        ]
    }

    /// The upper triangle of the normal matrix, row by row.
    #[inline(always)]
    pub fn triangle(&self) -> [V; 21] {
        let Self { ff, xx, yy, fx, fy, xy, .. } = *self;
        [
            ff.a, ff.b, fx.a, fx.b, fy.a, fy.b, ff.c, fx.c, fx.d, fy.c, fy.d, //
            xx.a, xx.b, xy.a, xy.b, xx.c, xy.c, xy.d, yy.a, yy.b, yy.c,
        ]
    }
}

/// Solves the twelve equations of each lane. `noise`: [`noise_square`] times the squared brightness.
#[inline(always)]
pub(super) fn solve_affine<T: SimdReal, V: Lanes<Scalar = T>>(rates: &LaneRates<V>, noise: V) -> LaneSolution<V> {
    eliminate::<T, V>(rates, noise).solution
}

/// As [`solve_affine`], keeping what the inverse is made of.
#[inline(always)]
pub(super) fn eliminate<T: SimdReal, V: Lanes<Scalar = T>>(rates: &LaneRates<V>, noise: V) -> Normal<V> {
    let tolerance = V::constant(pivot_tolerance::<T>());
    let [a, b, p, q, r] = rates.jet;
    let [e1, e2, e3, e4, e5, e6] = rates.minus_first;
    let [d1, d2, d3, d4, d5, d6] = rates.second;
    // The rows of J(i') hold minus i' here; so do, with the same sign, the products with i''.
    let (a1, b1, p1, q1, r1) = (e2, e3, e4, e5, e6);
    macro_rules! product {
        ($x:ident, $y:ident, $x1:ident, $y1:ident) => {
            $x.mul_add($y, $x1 * $y1)
        };
    }
    let (aa, ab, bb) = (product!(a, a, a1, a1), product!(a, b, a1, b1), product!(b, b, b1, b1));
    let (pp, pq, qq) = (product!(p, p, p1, p1), product!(p, q, p1, q1), product!(q, q, q1, q1));
    let (qr, rr, pr) = (product!(q, r, q1, r1), product!(r, r, r1, r1), product!(p, r, p1, r1));
    let (pa, pb) = (product!(p, a, p1, a1), product!(p, b, p1, b1));
    let (qa, qb) = (product!(q, a, q1, a1), product!(q, b, q1, b1));
    let (ra, rb) = (product!(r, a, r1, a1), product!(r, b, r1, b1));

    let three = V::constant(3.0);
    let ff = Sym { a: aa + (pp + qq), b: ab + (pq + qr), c: bb + (qq + rr) };
    let xx = Sym { a: pp.mul_add(three, ff.a), b: pq.mul_add(three, ff.b), c: qq.mul_add(three, ff.c) };
    let yy = Sym { a: qq.mul_add(three, ff.a), b: qr.mul_add(three, ff.b), c: rr.mul_add(three, ff.c) };
    let fx = Mat { a: pa, b: pb, c: qa, d: qb };
    let fy = Mat { a: qa, b: qb, c: ra, d: rb };
    let xy = Mat { a: pq, b: qq, c: pr, d: qr };

    let two = V::constant(2.0);
    let (e4, e6, d4, d6) = (e4 * two, e6 * two, d4 * two, d6 * two);
    macro_rules! side {
        ($(($c:ident, $e:ident, $c1:ident, $d:ident)),*) => {{
            let mut s = V::zero();
            $(s = $c.mul_add($e, $c1.mul_add($d, s));)*
            s
        }};
    }
    // Minus i' on the right for the first six rows; J(-i') i'' = -J(i') i'' for the others.
    let f = (
        side!((a, e1, a1, d1), (p, e2, p1, d2), (q, e3, q1, d3)),
        side!((b, e1, b1, d1), (q, e2, q1, d2), (r, e3, r1, d3)),
    );
    let x = (
        side!((a, e2, a1, d2), (p, e4, p1, d4), (q, e5, q1, d5)),
        side!((b, e2, b1, d2), (q, e4, q1, d4), (r, e5, r1, d5)),
    );
    let y = (
        side!((a, e3, a1, d3), (p, e5, p1, d5), (q, e6, q1, d6)),
        side!((b, e3, b1, d3), (q, e5, q1, d5), (r, e6, r1, d6)),
    );

    let (ff_inverse, t0) = ff.invert(ff.a, ff.c, tolerance, noise);
    let (wx, wy) = (ff_inverse.times(fx), ff_inverse.times(fy));
    let (x, y) = (wx.less_transposed(x, f), wy.less_transposed(y, f));
    let xx_left = xx.less(fx, wx);
    let xy_left = xy.less(fx, wy);
    let yy_left = yy.less(fy, wy);

    let (xx_inverse, t1) = xx_left.invert(xx.a, xx.c, tolerance, noise);
    let wxy = xx_inverse.times(xy_left);
    let y = wxy.less_transposed(y, x);
    let yy_left = yy_left.less(xy_left, wxy);

    let (yy_inverse, t2) = yy_left.invert(yy.a, yy.c, tolerance, noise);
    let y = yy_inverse.apply(y.0, y.1);
    let x = wxy.less_applied(xx_inverse.apply(x.0, x.1), y);
    let f = wy.less_applied(wx.less_applied(ff_inverse.apply(f.0, f.1), x), y);

    // Zero times something that is not finite is NaN, which no comparison trusts.
    let trust = t0.min(t1).min(t2) + f.0 * V::zero();
    let solution = LaneSolution { motion: [f.0, f.1, x.0, x.1, y.0, y.1], trust };
    Normal { ff, xx, yy, fx, fy, xy, ff_inverse, xx_inverse, yy_inverse, wx, wy, wxy, solution }
}
