//! Sums over points.
//!
//! With `T = G u`, `s = |T|`, `d = f - R w`: `s e = T_y d_x - T_x d_y` is the residual across the epipolar
//! line and `s m = T . d` the part along it (2). `lanes` has what a search repeats thousands of times (best
//! rotation, Gauss-Newton sums, depths), several points at once. Sums that an estimate needs a few dozen
//! times (given depths in the weights, depths before the camera) take single points.

mod lanes;

pub(crate) use lanes::{Depths, Equations, best_rotation, depths, equations, least_squares};

use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::{KnownRotation, Observations, Row};
use crate::motion3d::model::rows::{Matrix5, Vector5};
use crate::parallel;
use nalgebra::{Matrix2x3, Matrix3, SMatrix, Vector2};
use std::ops::{AddAssign, Range, SubAssign};

/// Adds up what `part` gives for each chunk, in the order of the chunks, whoever computes them.
fn over_chunks<const R: usize, const C: usize>(
    observations: &Observations,
    part: impl Fn(Range<usize>) -> SMatrix<f64, R, C> + Sync,
) -> SMatrix<f64, R, C> {
    let chunks: Vec<_> = observations.chunks().collect();
    if chunks.len() < 2 {
        return chunks.into_iter().map(&part).sum();
    }
    parallel::map(chunks, part).into_iter().sum()
}

/// A symmetric matrix from its upper triangle, row by row.
fn symmetric(upper: &[f64]) -> Matrix5 {
    let mut matrix = Matrix5::zeros();
    let mut values = upper.iter();
    for i in 0..5 {
        for (j, value) in (i..5).zip(&mut values) {
            (matrix[(i, j)], matrix[(j, i)]) = (*value, *value);
        }
    }
    matrix
}

/// Adds a 3 x 3 matrix, times a factor, to the block of the rotation.
pub(crate) fn add_to_rotation(h: &mut Matrix5, information: &Matrix3<f64>, factor: f64) {
    h.fixed_view_mut::<3, 3>(2, 2).add_assign(information * factor);
}

/// A point seen with one motion.
struct Seen {
    row: Row,
    /// `d = f - R w`.
    d: Vector2<f64>,
    s2: f64,
    /// `s e`.
    across: f64,
    /// `s m`.
    along: f64,
    /// `s D(1)`.
    far: Vector5,
}

impl Seen {
    /// `None` at the epipole, where a point says nothing.
    #[inline]
    fn new(points: &Observations, motion: &Motion, tangent: &Matrix2x3<f64>, k: usize) -> Option<Self> {
        let row = points.row(k);
        let (t, d) = (row.g * motion.u(), row.f - row.r * motion.w());
        let s2 = t.norm_squared();
        if s2 <= points.floor {
            return None;
        }
        let across = Vector2::new(t.y, -t.x);
        let (psi, turn) = (tangent * row.g.tr_mul(&across), row.r.tr_mul(&across));
        let far = Vector5::new(psi.x, psi.y, turn.x, turn.y, turn.z);
        Some(Self { across: across.dot(&d), along: t.dot(&d), row, d, s2, far })
    }

    /// `s D(nu)`.
    fn slopes(&self, nu: f64) -> Vector5 {
        let [a, b, x, y, z] = self.far.into();
        Vector5::new(nu * a, nu * b, x, y, z)
    }

    /// `1 / (s^2 + g kappa^2)` with `g = |G|^2 / 2`: what damped weights have for `1 / s^2`.
    fn damped(&self, spread: f64) -> f64 {
        1.0 / (self.s2 + 0.5 * spread * self.row.g.norm_squared())
    }
}

/// Sums what `of` makes of each point that is not at the epipole.
fn sum<const R: usize, const C: usize>(
    points: &Observations,
    at: &Weighted<'_>,
    of: impl Fn(usize, &Seen) -> SMatrix<f64, R, C> + Sync,
) -> SMatrix<f64, R, C> {
    over_chunks(points, |range| {
        let mut sum = SMatrix::zeros();
        for k in range.start..range.end.min(points.n) {
            if let Some(seen) = Seen::new(points, at.motion, at.tangent, k) {
                sum += of(k, &seen);
            }
        }
        sum
    })
}

/// Where equations are linearised, and the depths in their weights.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Weighted<'a> {
    pub motion: &'a Motion,
    /// Axes of the direction.
    pub tangent: &'a Matrix2x3<f64>,
    /// As many as the planes have values.
    pub nu: &'a [f64],
}

/// The row `D(nu)` of point `k`, 0 at the epipole.
pub(crate) fn slopes(points: &Observations, motion: &Motion, tangent: &Matrix2x3<f64>, nu: f64, k: usize) -> Vector5 {
    Seen::new(points, motion, tangent, k).map_or(Vector5::zeros(), |seen| seen.slopes(nu) / seen.s2.sqrt())
}

/// `sum D(nu)^t D(nu)` with weights damped within `kappa^2 = spread` of the epipole, the largest variance of
/// the direction.
pub(crate) fn information(points: &Observations, at: &Weighted<'_>, spread: f64) -> Matrix5 {
    // Each of both weights is damped: `s^2 / (s^2 + g kappa^2)`.
    let mut h = sum(points, at, |k, seen| {
        let row = seen.slopes(at.nu[k]);
        row * row.transpose() * (seen.damped(spread).powi(2) * seen.s2)
    });
    if let Some(known) = &points.prior {
        add_to_rotation(&mut h, &known.information, 1.0);
    }
    h
}

/// `sum D(nu)^t D(true)`, the slope of the estimating equation, without bias: true depths are taken from the
/// points' own flow, of which `share` is in `nu`.
pub(crate) fn slope(points: &Observations, at: &Weighted<'_>, share: &[f64], spread: f64) -> Matrix5 {
    let mut slope = sum(points, at, |k, seen| {
        let mut products = seen.slopes(at.nu[k]) * seen.slopes(seen.along / seen.s2).transpose();
        // The noise of the own depth is in both factors, by its share in the weight.
        let psi = seen.far.fixed_rows::<2>(0);
        products.fixed_view_mut::<2, 2>(0, 0).sub_assign(psi * psi.transpose() * (share[k] / seen.s2));
        products * seen.damped(spread)
    });
    if let Some(known) = &points.prior {
        add_to_rotation(&mut slope, &known.information, 1.0);
    }
    slope
}

/// The frozen estimating equation `sum V^t (s e)(u, w)`: five values, each bilinear in `u` and `(1, w)`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bilinear {
    /// `sum V^t h` of the residual `s e = sum_i u_i (h_i0 + sum_j h_ij w_j)`.
    sums: SMatrix<f64, 5, 12>,
    prior: Option<KnownRotation>,
}

impl Bilinear {
    /// With `D(nu)` as weights, damped within `kappa^2 = spread` of the epipole.
    pub fn new(points: &Observations, at: &Weighted<'_>, spread: f64) -> Self {
        let sums = sum(points, at, |k, seen| {
            let Row { g, r, f } = &seen.row;
            // V = W s / (s^2 + g kappa^2).
            let weights = seen.slopes(at.nu[k]) * seen.damped(spread);
            let mut h = SMatrix::<f64, 1, 12>::zeros();
            for c in 0..3 {
                let across = Vector2::new(g[(1, c)], -g[(0, c)]);
                h[4 * c] = across.dot(f);
                h.fixed_columns_mut::<3>(4 * c + 1).copy_from(&-(across.transpose() * r));
            }
            weights * h
        });
        Self { sums, prior: points.prior }
    }

    /// Its value at a motion, and its slopes along `tangent` and `w`.
    pub fn at(&self, motion: &Motion, tangent: &Matrix2x3<f64>) -> (Vector5, Matrix5) {
        let (u, w) = (motion.u(), motion.w());
        let (mut value, mut slope) = (Vector5::zeros(), Matrix5::zeros());
        for i in 0..3 {
            let turning = self.sums.fixed_columns::<3>(4 * i + 1);
            let along = self.sums.column(4 * i) + turning * w;
            value += along * u[i];
            slope.fixed_columns_mut::<2>(0).add_assign(along * tangent.column(i).transpose());
            slope.fixed_columns_mut::<3>(2).add_assign(turning * u[i]);
        }
        if let Some(known) = &self.prior {
            value.fixed_rows_mut::<3>(2).add_assign(&known.pull(&w).0);
            add_to_rotation(&mut slope, &known.information, -1.0);
        }
        (value, slope)
    }
}

/// The same with depths that must not be negative: the cost is `sum min over nu >= 0 of |f - nu G u - R
/// w|^2`. What no point determines stays where it is.
pub(crate) fn front_equations(points: &Observations, motion: &Motion, tangent: &Matrix2x3<f64>) -> Equations {
    let sums = sum(points, &Weighted { motion, tangent, nu: &[] }, |_, seen| {
        let mut out = SMatrix::<f64, 5, 7>::zeros();
        let Row { r, .. } = &seen.row;
        if seen.along < 0.0 {
            // A point that would lie behind has depth 0: what the rotation does not explain is left of it.
            out.fixed_view_mut::<3, 3>(2, 2).copy_from(&r.tr_mul(r));
            out.fixed_view_mut::<3, 1>(2, 5).copy_from(&r.tr_mul(&seen.d));
            out[(0, 6)] = seen.d.norm_squared();
        } else {
            let row = seen.slopes(seen.along / seen.s2);
            out.fixed_columns_mut::<5>(0).copy_from(&(row * row.transpose() / seen.s2));
            out.set_column(5, &(row * (seen.across / seen.s2)));
            out[(0, 6)] = seen.across * seen.across / seen.s2;
        }
        out
    });
    let mut out = Equations { h: sums.fixed_columns::<5>(0).into_owned(), ..Equations::default() };
    (out.gradient, out.cost) = (sums.column(5).into_owned(), sums[(0, 6)]);
    if let Some(known) = &points.prior {
        known.add(&motion.w(), &mut out.h, &mut out.gradient, &mut out.cost);
    }
    out.h += Matrix5::identity() * (1e-12 * out.h.trace());
    out
}
