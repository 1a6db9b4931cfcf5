//! The products that a window sums: the normal matrix and right-hand side of each pixel's own equations.
//!
//! With `A` the pixel's rows of `[J(i); J(i')]` and `b` those of `[i'; i'']`, the planes are the different
//! entries of `A^T A`, the entries of `A^T b` and `b^T b`. Unknowns are scaled to `(u, v, s u_x, s v_x, s
//! u_y, s v_y)`, s the window's sigma, so that all columns are of one order.

use crate::simd::Lanes;

/// Columns of the equations, in the scaled unknowns: which plane holds which product, and which moments are
/// needed of it.
///
/// `u`, `v` are transported (multiplied by x and y), so their products need six moments, those with the
/// Jacobian three, those within the Jacobian one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plan {
    /// Distinct products of the flow's columns with the Jacobian's: 0, 6 or 8.
    mixed: usize,
    /// Distinct entries among the Jacobian's own products: 0, 3 or 10.
    inner: usize,
    /// Planes of `A^T b`: 0, 2 or 6.
    right: usize,
}

/// `u u`, `u v`, `v v`.
pub(super) const FLOW_PLANES: usize = 3;
/// `Ixx Ix, Ixx Iy, Ixy Ix, Ixy Iy, Iyy Ix, Iyy Iy`.
const MIXED_PLANES: usize = 6;
/// Planes of the largest plan.
pub(super) const MAX_PLANES: usize = Plan::new(12).planes();

impl Plan {
    /// The plan of row 1 (`rows = 1`), rows 1-3, and rows 1-6 or 1-12 (`rows >= 6`).
    pub const fn new(rows: usize) -> Self {
        match rows {
            1 => Self { mixed: 0, inner: 0, right: 2 },
            3 => Self { mixed: MIXED_PLANES, inner: 3, right: 6 },
            _ => Self { mixed: MIXED_PLANES, inner: 10, right: 6 },
        }
    }

    /// The plan of a plain outer product `h h^T` of six columns.
    pub const fn outer() -> Self {
        Self { mixed: 8, inner: 10, right: 0 }
    }

    /// The plan of the outer product of the flow's two columns alone.
    pub const fn flow() -> Self {
        Self { mixed: 0, inner: 0, right: 0 }
    }

    /// Plane of the product of columns `i <= j`, whichever they are.
    #[inline(always)]
    pub const fn place(self, i: usize, j: usize) -> Option<usize> {
        if j < 2 {
            Some(i + j)
        } else if i < 2 {
            self.mixed(i, j)
        } else {
            self.inner(i, j)
        }
    }

    /// Planes of `A^T A`.
    pub const fn normal(self) -> usize {
        FLOW_PLANES + self.mixed + self.inner
    }
    /// Planes of `A^T b`: the first two with three moments, four more with one.
    pub const fn right(self) -> usize {
        self.right
    }
    /// All planes, that of `b^T b` included, which is the last; an outer product has none.
    pub const fn planes(self) -> usize {
        self.normal() + self.right + if self.right == 0 { 0 } else { 1 }
    }
    /// Highest power of an offset that plane `p` is weighted with.
    pub const fn order(self, p: usize) -> usize {
        let (normal, right) = (self.normal(), if self.right == 0 { 0 } else { 2 });
        if p < FLOW_PLANES {
            2
        } else if p < FLOW_PLANES + self.mixed || (p >= normal && p < normal + right) {
            1
        } else {
            0
        }
    }
    /// Where the moments of plane `p` begin in a list of all moments.
    pub const fn base(self, p: usize) -> usize {
        let mut base = 0;
        let mut q = 0;
        while q < p {
            base += moments(self.order(q));
            q += 1;
        }
        base
    }

    /// Plane of the product of columns `i` of the flow (0, 1) and `j` of the Jacobian (2 .. 6); `None` where
    /// there is none.
    #[inline(always)]
    pub const fn mixed(self, i: usize, j: usize) -> Option<usize> {
        const PLACE: [[usize; 4]; 2] = [[0, 1, 2, 3], [2, 3, 4, 5]];
        match self.mixed {
            0 => None,
            MIXED_PLANES => Some(FLOW_PLANES + PLACE[i][j - 2]),
            _ => Some(FLOW_PLANES + 4 * i + j - 2),
        }
    }

    /// Plane of the product of columns `i <= j` of the Jacobian (2 .. 6); `None` where it is zero.
    #[inline(always)]
    pub const fn inner(self, i: usize, j: usize) -> Option<usize> {
        const THREE: [[usize; 4]; 4] = [[0, 1, 9, 9], [9, 2, 9, 9], [9, 9, 0, 1], [9, 9, 9, 2]];
        const TEN: [[usize; 4]; 4] = [[0, 1, 2, 3], [9, 4, 5, 6], [9, 9, 7, 8], [9, 9, 9, 9]];
        let (first, r, c) = (FLOW_PLANES + self.mixed, i - 2, j - 2);
        match self.inner {
            0 => None,
            3 => {
                if THREE[r][c] == 9 {
                    None
                } else {
                    Some(first + THREE[r][c])
                }
            }
            _ => {
                if r == 3 {
                    Some(first + 9)
                } else {
                    Some(first + TEN[r][c])
                }
            }
        }
    }
}

/// Number of moments up to a power: 1; 1, x, y; 1, x, y, x^2, x y, y^2.
pub(super) const fn moments(order: usize) -> usize {
    (order + 1) * (order + 2) / 2
}

/// The jets that the equations of one pixel are made of: of the coefficient frame, of the first and of the
/// second time difference.
#[derive(Clone, Copy)]
pub(super) struct Jets<V> {
    pub coefficient: [V; 6],
    pub first: [V; 6],
    pub second: [V; 6],
}

/// Adds the products of one block of equations, `J(jet) m = rate`, to `planes`. `scale` is 1 / s.
#[inline(always)]
fn add_block<V: Lanes, const ROWS: usize>(
    plan: Plan,
    jet: &[V; 6],
    rate: &[V; 6],
    scale: V,
    planes: &mut [V; MAX_PLANES],
) {
    let [_, x, y, xx, xy, yy] = *jet;
    let n = plan.normal();
    let mut uu = x * x;
    let mut uv = x * y;
    let mut vv = y * y;
    let energy = plan.planes() - 1;
    planes[energy] = rate[0].mul_add(rate[0], planes[energy]);
    if ROWS == 1 {
        planes[n] = rate[0].neg_mul_add(x, planes[n]);
        planes[n + 1] = rate[0].neg_mul_add(y, planes[n + 1]);
    } else {
        let (sx, sy) = (x * scale, y * scale);
        let (gxx, gxy, gyy) = (sx * sx, sx * sy, sy * sy);
        uu = xx.mul_add(xx, xy.mul_add(xy, uu));
        uv = xx.mul_add(xy, xy.mul_add(yy, uv));
        vv = xy.mul_add(xy, yy.mul_add(yy, vv));
        let mixed = [xx * sx, xx * sy, xy * sx, xy * sy, yy * sx, yy * sy];
        for k in 0..MIXED_PLANES {
            planes[FLOW_PLANES + k] = planes[FLOW_PLANES + k] + mixed[k];
        }
        let inner = FLOW_PLANES + MIXED_PLANES;
        let [t, tx, ty, txx, txy, tyy] = *rate;
        planes[energy] = tx.mul_add(tx, ty.mul_add(ty, planes[energy]));
        let mut right = [sx * tx, sy * tx, sx * ty, sy * ty];
        if ROWS == 3 {
            for (k, g) in [gxx, gxy, gyy].into_iter().enumerate() {
                planes[inner + k] = planes[inner + k] + g;
            }
        } else {
            let (sxx, sxy, syy) = (xx * scale, xy * scale, yy * scale);
            let (dxx, dxy, dyy) = (sxx + sxx, sxy + sxy, syy + syy);
            // Rows 4, 5, 6: (2Ixx, 2Ixy, 0, 0), (Ixy, Iyy, Ixx, Ixy), (0, 0, 2Ixy, 2Iyy).
            let ten = [
                dxx.mul_add(dxx, sxy.mul_add(sxy, gxx)),
                dxx.mul_add(dxy, sxy.mul_add(syy, gxy)),
                sxy * sxx,
                sxy * sxy,
                dxy.mul_add(dxy, syy.mul_add(syy, gyy)),
                syy * sxx,
                syy * sxy,
                dxy.mul_add(dxy, sxx.mul_add(sxx, gxx)),
                dxy.mul_add(dyy, sxx.mul_add(sxy, gxy)),
                dyy.mul_add(dyy, sxy.mul_add(sxy, gyy)),
            ];
            for (k, p) in ten.into_iter().enumerate() {
                planes[inner + k] = planes[inner + k] + p;
            }
            right = [
                dxx.mul_add(txx, sxy.mul_add(txy, right[0])),
                dxy.mul_add(txx, syy.mul_add(txy, right[1])),
                dxy.mul_add(tyy, sxx.mul_add(txy, right[2])),
                dyy.mul_add(tyy, sxy.mul_add(txy, right[3])),
            ];
            planes[energy] = txx.mul_add(txx, txy.mul_add(txy, tyy.mul_add(tyy, planes[energy])));
        }
        let flow = [xx.mul_add(tx, xy.mul_add(ty, x * t)), xy.mul_add(tx, yy.mul_add(ty, y * t))];
        planes[n] = planes[n] - flow[0];
        planes[n + 1] = planes[n + 1] - flow[1];
        for (k, r) in right.into_iter().enumerate() {
            planes[n + 2 + k] = planes[n + 2 + k] - r;
        }
    }
    for (k, p) in [uu, uv, vv].into_iter().enumerate() {
        planes[k] = planes[k] + p;
    }
}

/// All product planes of one pixel for `ROWS` = 1, 3, 6 or 12 rows; the first [`Plan::planes`] are used.
#[inline(always)]
pub(super) fn products<V: Lanes, const ROWS: usize>(jets: &Jets<V>, scale: V) -> [V; MAX_PLANES] {
    let plan = Plan::new(ROWS);
    let mut planes = [V::zero(); MAX_PLANES];
    add_block::<V, ROWS>(plan, &jets.coefficient, &jets.first, scale, &mut planes);
    if ROWS == 12 {
        add_block::<V, ROWS>(plan, &jets.first, &jets.second, scale, &mut planes);
    }
    planes
}

#[cfg(test)]
mod tests {
    use super::super::options::RowSet;
    use super::*;

    /// The six rows of J(i), (21).
    fn motion_matrix([_, x, y, xx, xy, yy]: [f64; 6]) -> [[f64; 6]; 6] {
        [
            [x, y, 0.0, 0.0, 0.0, 0.0],
            [xx, xy, x, y, 0.0, 0.0],
            [xy, yy, 0.0, 0.0, x, y],
            [0.0, 0.0, 2.0 * xx, 2.0 * xy, 0.0, 0.0],
            [0.0, 0.0, xy, yy, xx, xy],
            [0.0, 0.0, 0.0, 0.0, 2.0 * xy, 2.0 * yy],
        ]
        .map(|row| row.map(|a| -a))
    }

    #[test]
    fn planes_are_the_products_of_the_rows() {
        let jets = Jets {
            coefficient: [0.3, 1.2, -0.7, 0.4, 0.9, -1.1],
            first: [0.8, -0.2, 0.5, 1.4, -0.6, 0.35],
            second: [-0.9, 0.15, 0.65, -0.45, 1.05, 0.75],
        };
        let scale = 1.0 / 3.0;
        let s = [1.0, 1.0, scale, scale, scale, scale];
        for rows in RowSet::EVERY {
            let plan = Plan::new(rows.count());
            let planes = match rows.count() {
                1 => products::<f64, 1>(&jets, scale),
                3 => products::<f64, 3>(&jets, scale),
                6 => products::<f64, 6>(&jets, scale),
                _ => products::<f64, 12>(&jets, scale),
            };
            let mut a: Vec<[f64; 6]> = motion_matrix(jets.coefficient)[..rows.count().min(6)].to_vec();
            let mut b: Vec<f64> = jets.first[..rows.count().min(6)].to_vec();
            if rows == RowSet::All {
                a.extend(motion_matrix(jets.first));
                b.extend(jets.second);
            }
            let normal = |i: usize, j: usize| s[i] * s[j] * a.iter().map(|r| r[i] * r[j]).sum::<f64>();
            let right = |i: usize| s[i] * a.iter().zip(&b).map(|(r, b)| r[i] * b).sum::<f64>();
            let near = |got: f64, want: f64| assert!((got - want).abs() < 1e-14, "{rows:?} {got} {want}");
            near(planes[0], normal(0, 0));
            near(planes[1], normal(0, 1));
            near(planes[2], normal(1, 1));
            near(planes[plan.planes() - 1], b.iter().map(|b| b * b).sum());
            for i in 0..2 {
                near(planes[plan.normal() + i], right(i));
                for j in 2..6 {
                    near(plan.mixed(i, j).map_or(0.0, |p| planes[p]), normal(i, j));
                }
            }
            for i in 2..6 {
                if plan.right() > 2 {
                    near(planes[plan.normal() + i], right(i));
                }
                for j in i..6 {
                    near(plan.inner(i, j).map_or(0.0, |p| planes[p]), normal(i, j));
                }
            }
        }
    }
}
