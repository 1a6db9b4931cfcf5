//! One frame of `i' = A(m) i` for lanes: Runge-Kutta and closed form, with derivatives along `m`.
//!
//! `A(m)` is block triangular: the Hessian feeds the gradient, the gradient feeds `I`, and `I` feeds nothing.

use super::{vector::plus, vector::times};
use crate::simd::Lanes;

/// A step over one frame.
pub(in crate::temporal) trait Step {
    /// Whether process noise acts inside the step (held constant) or is added at its end.
    const NOISE_INSIDE: bool;
    /// What a motion does to a 2-jet, ready to be applied to any number of them.
    type Map<V: Lanes>: Copy;
    /// The map of motion `m`.
    fn map<V: Lanes>(m: &[V; 6]) -> Self::Map<V>;
    /// The 2-jet after one frame; linear in `i`.
    fn apply<V: Lanes>(map: &Self::Map<V>, i: &[V; 6]) -> [V; 6];
    /// As [`Step::apply`] for a 2-jet without curvature, `(I, Ix, Iy)`.
    fn apply_slope<V: Lanes>(map: &Self::Map<V>, i: &[V; 3]) -> [V; 3];
    /// The brightness 2-jet after one frame of motion `m`.
    #[inline(always)]
    fn advance<V: Lanes>(i: &[V; 6], m: &[V; 6]) -> [V; 6] {
        Self::apply(&Self::map(m), i)
    }
    /// Derivative of [`Step::advance`] along component `direction` of `m`.
    fn tangent<V: Lanes>(i: &[V; 6], m: &[V; 6], direction: usize) -> [V; 6];
}

/// `A(m)`: the entries with their minus sign, and the doubled ones of the Hessian's rows.
#[derive(Clone, Copy)]
pub(in crate::temporal) struct Generator<V> {
    u: V,
    v: V,
    ux: V,
    vx: V,
    uy: V,
    vy: V,
    ux2: V,
    vx2: V,
    uy2: V,
    vy2: V,
    trace: V,
}

impl<V: Lanes> Generator<V> {
    #[inline(always)]
    pub(in crate::temporal) fn new(m: &[V; 6]) -> Self {
        let [u, v, ux, vx, uy, vy] = [-m[0], -m[1], -m[2], -m[3], -m[4], -m[5]];
        Self { u, v, ux, vx, uy, vy, ux2: ux + ux, vx2: vx + vx, uy2: uy + uy, vy2: vy + vy, trace: ux + vy }
    }

    /// `base + A y`, without the row of `I`, whose value nothing depends on.
    #[inline(always)]
    pub(in crate::temporal) fn add_slopes(&self, y: &[V; 6], base: &[V; 6]) -> [V; 6] {
        let [_, gx, gy, xx, xy, yy] = *y;
        [
            base[0],
            gx.mul_add(self.ux, gy.mul_add(self.vx, xx.mul_add(self.u, xy.mul_add(self.v, base[1])))),
            gx.mul_add(self.uy, gy.mul_add(self.vy, xy.mul_add(self.u, yy.mul_add(self.v, base[2])))),
            xx.mul_add(self.ux2, xy.mul_add(self.vx2, base[3])),
            xx.mul_add(self.uy, xy.mul_add(self.trace, yy.mul_add(self.vx, base[4]))),
            xy.mul_add(self.uy2, yy.mul_add(self.vy2, base[5])),
        ]
    }

    /// `base + A y`.
    #[inline(always)]
    pub(in crate::temporal) fn add(&self, y: &[V; 6], base: &[V; 6]) -> [V; 6] {
        let mut out = self.add_slopes(y, base);
        out[0] = self.brightness([y[1], y[2]], base[0]);
        out
    }

    /// `base + A y` for gradients without curvature.
    #[inline(always)]
    pub(in crate::temporal) fn add_slope(&self, y: [V; 2], base: [V; 2]) -> [V; 2] {
        [y[0].mul_add(self.ux, y[1].mul_add(self.vx, base[0])), y[0].mul_add(self.uy, y[1].mul_add(self.vy, base[1]))]
    }

    /// The row of `I` of `A y`: what a gradient adds to the brightness.
    #[inline(always)]
    pub(in crate::temporal) fn brightness(&self, gradient: [V; 2], base: V) -> V {
        gradient[0].mul_add(self.u, gradient[1].mul_add(self.v, base))
    }

    /// `A y`.
    #[inline(always)]
    pub(in crate::temporal) fn apply(&self, y: &[V; 6]) -> [V; 6] {
        self.add(y, &[V::zero(); 6])
    }
}

/// `J(y)`'s column `direction` (21): the derivative of `A(m) y` along that component of the motion.
#[inline(always)]
pub(in crate::temporal) fn direction<V: Lanes>(y: &[V; 6], direction: usize) -> [V; 6] {
    let o = V::zero();
    let [gx, gy, xx, xy, yy] = [-y[1], -y[2], -y[3], -y[4], -y[5]];
    match direction {
        0 => [gx, xx, xy, o, o, o],
        1 => [gy, xy, yy, o, o, o],
        2 => [o, gx, o, xx + xx, xy, o],
        3 => [o, gy, o, xy + xy, yy, o],
        4 => [o, o, gx, o, xx, xy + xy],
        _ => [o, o, gy, o, xy, yy + yy],
    }
}

#[inline(always)]
fn scaled<V: Lanes, const K: usize>(y: &[V; K], factor: f64) -> [V; K] {
    times(y, V::constant(factor))
}

/// One classical Runge-Kutta step: `1 + A + A^2/2 + A^3/6 + A^4/24` for constant `m`.
pub(in crate::temporal) struct Rk4;

impl Step for Rk4 {
    const NOISE_INSIDE: bool = true;

    type Map<V: Lanes> = Generator<V>;

    #[inline(always)]
    fn map<V: Lanes>(m: &[V; 6]) -> Generator<V> {
        Generator::new(m)
    }

    #[inline(always)]
    fn apply<V: Lanes>(a: &Generator<V>, i: &[V; 6]) -> [V; 6] {
        // Horner, the factorials in the multiples of i: i + A (24 i + A (12 i + A (4 i + A i))) / 24.
        let y = a.add_slopes(i, &scaled(i, 4.0));
        let y = a.add_slopes(&y, &scaled(i, 12.0));
        let y = a.add_slopes(&y, &scaled(i, 24.0));
        a.add(&scaled(&y, 1.0 / 24.0), i)
    }

    #[inline(always)]
    fn apply_slope<V: Lanes>(a: &Generator<V>, i: &[V; 3]) -> [V; 3] {
        let mut y = [i[1], i[2]];
        for multiple in [4.0, 12.0, 24.0] {
            let multiple = V::constant(multiple);
            y = a.add_slope(y, [i[1] * multiple, i[2] * multiple]);
        }
        let y = scaled(&y, 1.0 / 24.0);
        let [gx, gy] = a.add_slope(y, [i[1], i[2]]);
        [a.brightness(y, i[0]), gx, gy]
    }

    #[inline(always)]
    fn tangent<V: Lanes>(i: &[V; 6], m: &[V; 6], k: usize) -> [V; 6] {
        let a = Generator::new(m);
        let (mut y, mut t) = (*i, [V::zero(); 6]);
        for order in [4.0, 3.0, 2.0, 1.0] {
            let slope = scaled(&a.add(&t, &direction(&y, k)), 1.0 / order);
            let step = scaled(&a.apply(&y), 1.0 / order);
            t = slope;
            y = plus(i, &step);
        }
        t
    }
}

/// The closed form, through the affine map `p -> E p + e` that carries a point back over one frame.
pub(in crate::temporal) struct Exact;

/// `[E | e]`: `xx, xy, yx, yy` of E, then e.
pub(in crate::temporal) type Affine<V> = [V; 6];

/// Halvings before, and squarings after, the exponential's series.
const SQUARINGS: usize = 6;
/// Terms of the series: with motions up to 10 per frame the next one is below 1e-16.
const TERMS: usize = 9;

/// `a b` for affine maps with `b`'s last row zero or one.
#[inline(always)]
fn linear_product<V: Lanes>(a: &[V; 4], b: &Affine<V>) -> Affine<V> {
    [
        a[0].mul_add(b[0], a[1] * b[2]),
        a[0].mul_add(b[1], a[1] * b[3]),
        a[2].mul_add(b[0], a[3] * b[2]),
        a[2].mul_add(b[1], a[3] * b[3]),
        a[0].mul_add(b[4], a[1] * b[5]),
        a[2].mul_add(b[4], a[3] * b[5]),
    ]
}

#[inline(always)]
fn linear_part<V: Lanes>(a: &Affine<V>) -> [V; 4] {
    [a[0], a[1], a[2], a[3]]
}

/// `expm(-[[M, (u, v)^T], [0, 0]]) - 1` as `[E - 1 | e]`, and its derivative along one motion component.
///
/// The identity is left out until the end, so that small motions keep their digits.
#[inline(always)]
fn backward_map<V: Lanes, const TANGENT: bool>(m: &[V; 6], k: usize) -> (Affine<V>, Affine<V>) {
    let shrink = -1.0 / f64::from(1u32 << SQUARINGS);
    // m = (u, v, u_x, v_x, u_y, v_y); M = [[u_x, u_y], [v_x, v_y]].
    let x: Affine<V> = scaled(&[m[2], m[4], m[3], m[5], m[0], m[1]], shrink);
    let mut dx = [V::zero(); 6];
    if TANGENT {
        dx[[4, 5, 0, 2, 1, 3][k]] = V::constant(shrink);
    }
    // D = X (1 + X/2 (1 + X/3 (...))) = X + X D' with D' the inner bracket less 1, divided by its order.
    let (mut d, mut t) = ([V::zero(); 6], [V::zero(); 6]);
    for order in (1..=TERMS).rev() {
        let inverse = 1.0 / order as f64;
        if TANGENT {
            let (p, q) = (linear_product(&linear_part(&dx), &d), linear_product(&linear_part(&x), &t));
            t = scaled(&plus(&dx, &plus(&p, &q)), inverse);
        }
        let p = linear_product(&linear_part(&x), &d);
        d = scaled(&plus(&x, &p), inverse);
    }
    // (1 + D)^2 = 1 + (2 D + D^2).
    for _ in 0..SQUARINGS {
        if TANGENT {
            let (p, q) = (linear_product(&linear_part(&t), &d), linear_product(&linear_part(&d), &t));
            t = plus(&plus(&t, &t), &plus(&p, &q));
        }
        let p = linear_product(&linear_part(&d), &d);
        d = plus(&plus(&d, &d), &p);
    }
    (d, t)
}

/// `(H e, H D)` columns: the Hessian times `e` and times the two columns of `D`.
#[inline(always)]
fn hessian_times<V: Lanes>(i: &[V; 6], a: V, b: V) -> (V, V) {
    (i[3].mul_add(a, i[4] * b), i[4].mul_add(a, i[5] * b))
}

/// `D^T (a, b)`.
#[inline(always)]
fn transposed_times<V: Lanes>(d: &Affine<V>, a: V, b: V) -> (V, V) {
    (d[0].mul_add(a, d[2] * b), d[1].mul_add(a, d[3] * b))
}

impl Step for Exact {
    const NOISE_INSIDE: bool = false;

    type Map<V: Lanes> = Affine<V>;

    #[inline(always)]
    fn map<V: Lanes>(m: &[V; 6]) -> Affine<V> {
        backward_map::<V, false>(m, 0).0
    }

    #[inline(always)]
    fn apply_slope<V: Lanes>(d: &Affine<V>, i: &[V; 3]) -> [V; 3] {
        let (dx, dy) = transposed_times(d, i[1], i[2]);
        [d[4].mul_add(i[1], d[5].mul_add(i[2], i[0])), i[1] + dx, i[2] + dy]
    }

    #[inline(always)]
    fn apply<V: Lanes>(d: &Affine<V>, i: &[V; 6]) -> [V; 6] {
        let half = V::constant(0.5);
        // I + g.e + e^T H e / 2, and E = 1 + D in the others.
        let (hx, hy) = hessian_times(i, d[4], d[5]);
        let value = d[4].mul_add(hx.mul_add(half, i[1]), d[5].mul_add(hy.mul_add(half, i[2]), i[0]));
        let (gx, gy) = (i[1] + hx, i[2] + hy);
        let (dgx, dgy) = transposed_times(d, gx, gy);
        // E^T H E = H + (H D) + (H D)^T + D^T H D, by its columns.
        let (ax, ay) = hessian_times(i, d[0], d[2]);
        let (bx, by) = hessian_times(i, d[1], d[3]);
        let (axx, axy) = transposed_times(d, ax, ay);
        let (_, bxy) = transposed_times(d, bx, by);
        [value, gx + dgx, gy + dgy, i[3] + (ax + ax) + axx, i[4] + (ay + bx) + axy, i[5] + (by + by) + bxy]
    }

    #[inline(always)]
    fn tangent<V: Lanes>(i: &[V; 6], m: &[V; 6], k: usize) -> [V; 6] {
        let (d, t) = backward_map::<V, true>(m, k);
        let (hx, hy) = hessian_times(i, d[4], d[5]);
        let (sx, sy) = hessian_times(i, t[4], t[5]);
        let (gx, gy) = (i[1] + hx, i[2] + hy);
        // d(g.e + e^T H e / 2) = (g + H e).de.
        let value = t[4].mul_add(gx, t[5] * gy);
        // d(E^T (g + H e)) = dE^T (g + H e) + E^T H de.
        let (px, py) = transposed_times(&t, gx, gy);
        let (qx, qy) = transposed_times(&d, sx, sy);
        // d(E^T H E) = dE^T H E + transpose; H E = H + H D.
        let (ax, ay) = hessian_times(i, d[0], d[2]);
        let (bx, by) = hessian_times(i, d[1], d[3]);
        let (axx, ayx) = transposed_times(&t, i[3] + ax, i[4] + ay);
        let (bxx, byx) = transposed_times(&t, i[4] + bx, i[5] + by);
        [value, px + sx + qx, py + sy + qy, axx + axx, ayx + bxx, byx + byx]
    }
}
