//! What errors that go together over some distance do to a covariance.
//!
//! Sums over points that are taken for independent make the covariance too small where neighbours err alike.
//! With the correlation `rho(d)` of two errors at the distance `d`, the equations `sum W^t e` have the
//! covariance `sum_kl rho(d_kl) W_k^t W_l` instead of `sum W^t W`: neighbours count by how much their rows
//! agree. How far errors correlate beyond the given length, and how large they are, is estimated from the
//! residuals ([`Errors`]): edges in depth correlate errors farther than windows do.

use crate::motion3d::kernels::{depths, information, slopes};
use crate::motion3d::model::input::Flow;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::{Observations, Row};
use crate::motion3d::model::rows::{Matrix5, Vector5};
use crate::motion3d::solver::covariance::inverse;
use nalgebra::{Matrix2x3, Matrix3, SymmetricEigen, Vector3};
use rayon::prelude::*;

/// Share of correlation that falls off as windows stop sharing pixels, and the length, in correlation
/// lengths, of the rest: measured on residuals of a recorded drive.
const QUICK: f64 = 0.4;
const TAIL: f64 = 3.75;

/// Correlation lengths at which what is left, one hundredth, no longer counts.
const REACH: f64 = 15.0;

/// Correlation of the errors of windowed flow at a distance, in correlation lengths: `0.4 exp(-d^2 / 4) + 0.6
/// exp(-d / 3.75)`.
fn correlation(distance: f64) -> f64 {
    QUICK * (-0.25 * distance * distance).exp() + (1.0 - QUICK) * (-distance / TAIL).exp()
}

/// The area over which errors are one, `int rho`, in squared correlation lengths: sums over larger areas err
/// as if so much of it were one point.
pub(crate) fn area() -> f64 {
    std::f64::consts::PI * (4.0 * QUICK + 2.0 * (1.0 - QUICK) * TAIL * TAIL)
}

/// A motion whose equations have these depths in their weights.
pub(crate) struct Weighted<'a> {
    pub motion: &'a Motion,
    pub tangent: &'a Matrix2x3<f64>,
    /// As long as the planes.
    pub nu: &'a [f64],
}

/// The covariance where errors go together over `length`, in the unit of the points: in no direction smaller
/// than `covariance`, which takes the points for independent.
///
/// From `covariance = X B X` with `B = sum W^t W` follows the `X` that the equations' errors are multiplied
/// with: the geometric mean of the covariance and `B^-1`.
pub(crate) fn correlated_covariance(
    covariance: &Matrix5,
    inliers: &Observations,
    at: &Weighted<'_>,
    flow: &Flow<'_>,
    length: f64,
) -> Option<Matrix5> {
    let squares = information(inliers, at.motion, at.tangent, at.nu, 0.0);
    let points = Neighbourhood::new(inliers, at, flow, length);
    let errors = Errors::from_residuals(&points, &inverse(&squares)?, inliers.own());
    let l = squares.cholesky()?.l();
    let back = l.try_inverse()?;
    let larger = Matrix5::identity() + positive(&(back * correlation_excess(&points, &errors) * back.transpose()));
    let normalised = l.transpose() * covariance * l;
    let normalised = SymmetricEigen::new(normalised.symmetric_part());
    let root = normalised.eigenvalues.map(|size| size.max(0.0).sqrt());
    let root = normalised.eigenvectors * Matrix5::from_diagonal(&root) * normalised.eigenvectors.transpose();
    let out = back.transpose() * root * larger * root * back;
    let out = out.symmetric_part();
    inverse(&out).map(|_| out)
}

/// The same of a rotation alone, whose residuals are flow of two components.
pub(crate) fn correlated_rotation_covariance(
    covariance: &Matrix3<f64>,
    inliers: &Observations,
    w: &Vector3<f64>,
    flow: &Flow<'_>,
    length: f64,
) -> Matrix3<f64> {
    let mut inverse = Matrix5::zeros();
    inverse.fixed_view_mut::<3, 3>(2, 2).copy_from(covariance);
    let of_axis = |axis: usize| {
        let points = Neighbourhood::of_rotation(inliers, w, axis, flow, length);
        correlation_excess(&points, &Errors::from_residuals(&points, &inverse, inliers.own()))
    };
    inverse += inverse * positive(&(of_axis(0) + of_axis(1))) * inverse;
    inverse.fixed_view::<3, 3>(2, 2).into_owned()
}

/// The positive part of a symmetric matrix: correlation adds no information.
fn positive(matrix: &Matrix5) -> Matrix5 {
    let eigen = SymmetricEigen::new(matrix.symmetric_part());
    let sizes = eigen.eigenvalues.map(|size| size.max(0.0));
    eigen.eigenvectors * Matrix5::from_diagonal(&sizes) * eigen.eigenvectors.transpose()
}

/// What correlation adds to `sum W^t W`: the products of different points, less what the given noise
/// has too much for each point's own where several share one error.
fn correlation_excess(points: &Neighbourhood, errors: &Errors) -> Matrix5 {
    points.different(errors.stretch) * errors.variance + points.squares() * (errors.variance - 1.0)
}

/// Residuals nearer than this many correlation lengths are compared: three times the usual distance of
/// points.
const NEAR: f64 = 6.0;

/// Minimum number of points that determine how far errors correlate.
const FEWEST: usize = 30;

/// By how much the correlation length may be longer than given, and the steps in which that is looked for.
const LONGEST: f64 = 4.0;
const STEP: f64 = 1.15;

/// Points that sums over pairs are made from; of more, every so manieth stands for its neighbours.
const MAX_PAIR_POINTS: usize = 2000;

/// The least share of the errors' variance that is left in residuals, for them to determine it.
const LEFT: f64 = 0.1;

/// What is known of the errors of the points.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Errors {
    /// By how much the correlation length is longer than given.
    pub stretch: f64,
    /// Their variance in units of the given noise, not below that of a point's own.
    pub variance: f64,
}

impl Errors {
    /// `inverse`: that of the equations' information; `own`: the standard deviation of a point's own error.
    ///
    /// Fitting a motion takes what looks like one out of the residuals: of errors with the correlations `R`
    /// they have the covariance `(I - H) R (I - H)^t`, `H = W A^-1 W^t`. The shortest stretch is taken for
    /// which that makes residuals of neighbours as alike as they are.
    pub fn from_residuals(points: &Neighbourhood, inverse: &Matrix5, own: f64) -> Self {
        let squares: f64 = points.all.iter().map(|point| point.residual.powi(2)).sum();
        let (near, products) = points.near();
        let alike = products / squares;
        let mut stretch = 1.0;
        let mut expected = points.expected(&near, inverse, stretch);
        while points.all.len() >= FEWEST && expected.alike < alike && stretch * STEP <= LONGEST {
            let next = points.expected(&near, inverse, stretch * STEP);
            // Longer ones look like a motion, and show in no residual.
            if next.alike <= expected.alike {
                break;
            }
            (stretch, expected) = (stretch * STEP, next);
        }
        Self { stretch, variance: (squares / expected.squares).max(own * own) }
    }
}

/// A point as others see it.
struct Point {
    /// Where it was given, in correlation lengths.
    place: Vector3<f64>,
    /// `W`.
    row: Vector5,
    residual: f64,
}

/// Points from top to bottom, so that only a band of them is near one.
pub(crate) struct Neighbourhood {
    all: Vec<Point>,
}

/// What residuals are expected to be: their squares, in units of the errors', and products of near ones in
/// units of that.
struct Expected {
    squares: f64,
    alike: f64,
}

impl Neighbourhood {
    pub fn new(inliers: &Observations, at: &Weighted<'_>, flow: &Flow<'_>, length: f64) -> Self {
        let residuals = depths(inliers, at.motion).e;
        let row = |k: usize| (slopes(inliers, at.motion, at.tangent, at.nu[k], k), residuals[k]);
        Self::of(inliers, flow, length, row)
    }

    /// The same of one component of the flow that a rotation alone leaves.
    pub fn of_rotation(inliers: &Observations, w: &Vector3<f64>, axis: usize, flow: &Flow<'_>, length: f64) -> Self {
        Self::of(inliers, flow, length, |k| {
            let Row { r, f, .. } = inliers.row(k);
            let turn = r.row(axis);
            (Vector5::new(0.0, 0.0, turn[0], turn[1], turn[2]), f[axis] - (turn * w)[0])
        })
    }

    fn of(inliers: &Observations, flow: &Flow<'_>, length: f64, row: impl Fn(usize) -> (Vector5, f64)) -> Self {
        let point = |k: usize| {
            let (row, residual) = row(k);
            Point { place: flow.place(inliers.source[k] as usize) / length, row, residual }
        };
        let mut all: Vec<Point> = (0..inliers.n).map(point).collect();
        all.sort_by(|a, b| a.place.y.total_cmp(&b.place.y));
        Self { all }
    }

    /// `sum W^t W`.
    pub fn squares(&self) -> Matrix5 {
        self.all.iter().map(|point| point.row * point.row.transpose()).sum()
    }

    /// `sum rho(d_kl) W_k^t W_l` over different points.
    pub fn different(&self, stretch: f64) -> Matrix5 {
        let of_point = |k: usize| {
            let product = self.all[k].row * self.correlated(k, stretch).0.transpose();
            product.symmetric_part()
        };
        let (parts, each) = self.parts(of_point);
        parts.iter().sum::<Matrix5>() * each
    }

    /// The other points within a distance of point `k`, and their distances.
    fn around(&self, k: usize, reach: f64) -> impl Iterator<Item = (usize, f64)> + '_ {
        let here = self.all[k].place;
        let first = self.all.partition_point(|point| point.place.y <= here.y - reach);
        let band = self.all.iter().enumerate().skip(first);
        let band = band.take_while(move |(_, point)| point.place.y - here.y < reach);
        let near = band.filter(move |(l, point)| *l != k && (point.place.x - here.x).abs() < reach);
        near.map(move |(l, point)| (l, (point.place - here).norm()))
    }

    /// Rows of the other points times their correlations with point `k`, and the correlations of the near
    /// ones added up.
    fn correlated(&self, k: usize, stretch: f64) -> (Vector5, f64) {
        let (mut rows, mut near) = (Vector5::zeros(), 0.0);
        for (l, distance) in self.around(k, REACH * stretch) {
            let rho = correlation(distance / stretch);
            rows += self.all[l].row * rho;
            if distance < NEAR {
                near += rho;
            }
        }
        (rows, near)
    }

    /// Rows of the neighbours of each point, added up, and products of near residuals.
    fn near(&self) -> (Vec<Vector5>, f64) {
        let of_point = |k: usize| {
            let (mut rows, mut alike) = (Vector5::zeros(), 0.0);
            for (l, _) in self.around(k, NEAR).filter(|(_, distance)| *distance < NEAR) {
                rows += self.all[l].row;
                alike += self.all[k].residual * self.all[l].residual;
            }
            (rows, alike)
        };
        let (rows, alike): (Vec<Vector5>, Vec<f64>) = (0..self.all.len()).into_par_iter().map(of_point).unzip();
        (rows, alike.iter().sum())
    }

    /// With `U = R W`, `B = W^t U` and the rows `N` of neighbours added up, the products of near residuals
    /// are `sum R - 2 tr A^-1 U^t N + tr A^-1 B A^-1 W^t N`, and the squares the same with `N = W`.
    fn expected(&self, near: &[Vector5], inverse: &Matrix5, stretch: f64) -> Expected {
        let of_point = |k: usize| {
            let (rows, correlations) = self.correlated(k, stretch);
            let own = &self.all[k].row;
            let whole = rows + own;
            (whole * own.transpose(), whole * near[k].transpose(), correlations)
        };
        let (parts, each) = self.parts(of_point);
        let b: Matrix5 = parts.iter().map(|(own, _, _)| own).sum::<Matrix5>() * each;
        let n: Matrix5 = parts.iter().map(|(_, near, _)| near).sum::<Matrix5>() * each;
        let correlations = parts.iter().map(|(_, _, correlations)| correlations).sum::<f64>() * each;
        let products: Matrix5 = self.all.iter().zip(near).map(|(point, near)| point.row * near.transpose()).sum();
        let middle = inverse * b * inverse;
        let count = self.all.len() as f64;
        let squares = count - 2.0 * (inverse * b).trace() + (middle * self.squares()).trace();
        let squares = squares.max(LEFT * count);
        let alike = correlations - 2.0 * (inverse * n).trace() + (middle * products).trace();
        Expected { squares, alike: alike / squares }
    }

    /// What is added up over all points, or over those that stand for them, and how many each of these stands
    /// for; in one order, whoever computes it.
    fn parts<S: Send>(&self, of_point: impl Fn(usize) -> S + Sync + Send) -> (Vec<S>, f64) {
        let step = self.all.len().div_ceil(MAX_PAIR_POINTS).max(1);
        let chosen: Vec<usize> = (step / 2..self.all.len()).step_by(step).collect();
        let each = self.all.len() as f64 / chosen.len().max(1) as f64;
        (chosen.into_par_iter().map(of_point).collect(), each)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_go_together_less_with_distance() {
        assert_eq!(correlation(0.0), 1.0);
        let values: Vec<f64> = (0..16).map(|d| correlation(f64::from(d))).collect();
        assert!(values.windows(2).all(|pair| pair[1] < pair[0]), "{values:?}");
        // At four correlation lengths a fifth is left, at fifteen one hundredth.
        assert!((0.15..0.25).contains(&values[4]) && values[15] < 0.012, "{values:?}");
    }
}
