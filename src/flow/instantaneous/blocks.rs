//! 2x2 blocks in lanes, as the normal equations are eliminated by them.

use crate::simd::Lanes;

/// Symmetric 2x2: `[[a, b], [b, c]]`.
#[derive(Clone, Copy)]
pub(super) struct Sym<V> {
    pub a: V,
    pub b: V,
    pub c: V,
}

/// General 2x2, row by row.
#[derive(Clone, Copy)]
pub(super) struct Mat<V> {
    pub a: V,
    pub b: V,
    pub c: V,
    pub d: V,
}

impl<V: Lanes> Sym<V> {
    /// The inverse, and how far the determinant is above what is trusted, for columns of squared lengths
    /// `n0`, `n1`.
    #[inline(always)]
    pub fn invert(self, n0: V, n1: V, tolerance: V, noise: V) -> (Self, V) {
        let det = self.b.neg_mul_add(self.b, self.a * self.c);
        let one = V::constant(1.0);
        let r = one / det;
        // det = product of the two pivots; noise may explain neither of them.
        let limit = (n0 * n1).mul_add(tolerance, (n0 + n1) * noise);
        (Self { a: self.c * r, b: -(self.b * r), c: self.a * r }, det - limit)
    }

    /// `self * m`.
    #[inline(always)]
    pub fn times(self, m: Mat<V>) -> Mat<V> {
        Mat {
            a: self.a.mul_add(m.a, self.b * m.c),
            b: self.a.mul_add(m.b, self.b * m.d),
            c: self.b.mul_add(m.a, self.c * m.c),
            d: self.b.mul_add(m.b, self.c * m.d),
        }
    }

    /// `self - m w^T`, known to be symmetric.
    #[inline(always)]
    pub fn less_product(self, m: Mat<V>, w: Mat<V>) -> Self {
        Self {
            a: m.a.neg_mul_add(w.a, m.b.neg_mul_add(w.b, self.a)),
            b: m.a.neg_mul_add(w.c, m.b.neg_mul_add(w.d, self.b)),
            c: m.c.neg_mul_add(w.c, m.d.neg_mul_add(w.d, self.c)),
        }
    }

    /// `self * (x, y)`.
    #[inline(always)]
    pub fn apply(self, x: V, y: V) -> (V, V) {
        (self.a.mul_add(x, self.b * y), self.b.mul_add(x, self.c * y))
    }

    /// `self - m^T w`, known to be symmetric.
    #[inline(always)]
    pub fn less(self, m: Mat<V>, w: Mat<V>) -> Self {
        Self {
            a: m.a.neg_mul_add(w.a, m.c.neg_mul_add(w.c, self.a)),
            b: m.a.neg_mul_add(w.b, m.c.neg_mul_add(w.d, self.b)),
            c: m.b.neg_mul_add(w.b, m.d.neg_mul_add(w.d, self.c)),
        }
    }
}

impl<V: Lanes> Mat<V> {
    #[inline(always)]
    pub fn negative(self) -> Self {
        Self { a: -self.a, b: -self.b, c: -self.c, d: -self.d }
    }

    /// `self * s`.
    #[inline(always)]
    pub fn times_symmetric(self, s: Sym<V>) -> Self {
        Self {
            a: self.a.mul_add(s.a, self.b * s.b),
            b: self.a.mul_add(s.b, self.b * s.c),
            c: self.c.mul_add(s.a, self.d * s.b),
            d: self.c.mul_add(s.b, self.d * s.c),
        }
    }

    /// `self + m w`.
    #[inline(always)]
    pub fn plus_product(self, m: Self, w: Self) -> Self {
        Self {
            a: m.a.mul_add(w.a, m.b.mul_add(w.c, self.a)),
            b: m.a.mul_add(w.b, m.b.mul_add(w.d, self.b)),
            c: m.c.mul_add(w.a, m.d.mul_add(w.c, self.c)),
            d: m.c.mul_add(w.b, m.d.mul_add(w.d, self.d)),
        }
    }

    /// `self + m w^T`.
    #[inline(always)]
    pub fn plus_product_transposed(self, m: Self, w: Self) -> Self {
        self.plus_product(m, Self { a: w.a, b: w.c, c: w.b, d: w.d })
    }

    /// `self - m^T w`.
    #[inline(always)]
    pub fn less(self, m: Self, w: Self) -> Self {
        Self {
            a: m.a.neg_mul_add(w.a, m.c.neg_mul_add(w.c, self.a)),
            b: m.a.neg_mul_add(w.b, m.c.neg_mul_add(w.d, self.b)),
            c: m.b.neg_mul_add(w.a, m.d.neg_mul_add(w.c, self.c)),
            d: m.b.neg_mul_add(w.b, m.d.neg_mul_add(w.d, self.d)),
        }
    }

    /// `(p, q) - self^T (x, y)`.
    #[inline(always)]
    pub fn less_transposed(self, (p, q): (V, V), (x, y): (V, V)) -> (V, V) {
        (self.a.neg_mul_add(x, self.c.neg_mul_add(y, p)), self.b.neg_mul_add(x, self.d.neg_mul_add(y, q)))
    }

    /// `(p, q) - self (x, y)`.
    #[inline(always)]
    pub fn less_applied(self, (p, q): (V, V), (x, y): (V, V)) -> (V, V) {
        (self.a.neg_mul_add(x, self.b.neg_mul_add(y, p)), self.c.neg_mul_add(x, self.d.neg_mul_add(y, q)))
    }
}
