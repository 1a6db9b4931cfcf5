//! The least-squares quadratic over a rectangle, as products of one-dimensional filters.
//!
//! On each axis let `p0 = 1, p1 = x - a, p2 = x^2 - b x - c` be orthogonal under the weights of that axis
//! (three-term recurrence, G. E. Forsythe 1957). The products `p_i(x) p_j(y)`, `i + j <= 2`, are then
//! orthogonal over the rectangle, so each coefficient of the fit is one separable filter, and the jet at the
//! site follows from the six coefficients.

use super::{neighbourhood::side_offsets, neighbourhood::weight};

/// The filters of one axis.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    /// `filters[i][k]`: weight of the k-th sample in the coefficient of `p_i`.
    pub filters: [Vec<f64>; 3],
    /// `p1 = x - a`.
    pub a: f64,
    /// `p2 = x^2 - b x - c`.
    pub b: f64,
    pub c: f64,
}

impl Axis {
    /// The filters over `side` samples; `None` when the weights leave fewer than three usable samples.
    pub fn new(side: usize, sigma: Option<f64>) -> Option<Self> {
        let x: Vec<f64> = side_offsets(side).map(f64::from).collect();
        let w: Vec<f64> = x.iter().map(|&x| weight(sigma, x)).collect();
        let dot = |f: &dyn Fn(f64) -> f64, g: &dyn Fn(f64) -> f64| -> f64 {
            x.iter().zip(&w).map(|(&x, w)| w * f(x) * g(x)).sum()
        };
        let one = |_: f64| 1.0;
        let n0 = dot(&one, &one);
        // Offsets symmetric about the site have odd moments of exactly zero, without rounding noise.
        let symmetric = side % 2 == 1;
        let a = if symmetric { 0.0 } else { dot(&one, &|x| x) / n0 };
        let p1 = move |x: f64| x - a;
        let n1 = dot(&p1, &p1);
        let b1 = if symmetric { 0.0 } else { dot(&p1, &|x| x * x) / n1 };
        let c0 = dot(&one, &|x| x * x) / n0;
        // x^2 minus its projections on p1 and p0: x^2 - b1 (x - a) - c0.
        let (b, c) = (b1, c0 - b1 * a);
        let p2 = move |x: f64| x * x - b * x - c;
        let n2 = dot(&p2, &p2);
        if !(n1 > 1e-12 * n0 && n2 > 1e-12 * n0) {
            return None;
        }
        let filter = |p: &dyn Fn(f64) -> f64, n: f64| x.iter().zip(&w).map(|(&x, w)| w * p(x) / n).collect();
        Some(Self { filters: [filter(&one, n0), filter(&p1, n1), filter(&p2, n2)], a, b, c })
    }

    /// Offsets are symmetric about the site, so that `a = b = 0`.
    pub fn is_symmetric(&self) -> bool {
        self.a == 0.0 && self.b == 0.0
    }
}

/// From coefficients to the jet: row `j` gives component `j` from `(c00, c10, c01, c20, c11, c02)`.
pub(super) fn taylor(x: &Axis, y: &Axis) -> [[f64; 6]; 6] {
    [
        [1.0, -x.a, -y.a, -x.c, x.a * y.a, -y.c],
        [0.0, 1.0, 0.0, -x.b, -y.a, 0.0],
        [0.0, 0.0, 1.0, 0.0, -x.a, -y.b],
        [0.0, 0.0, 0.0, 2.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 2.0],
    ]
}
