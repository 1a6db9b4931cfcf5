//! What errors that go together over some distance do to a covariance.
//!
//! Sums over points that are taken for independent make the covariance too small where neighbours err alike.
//! With the correlation `rho(d)` of two errors at the distance `d`, the equations `sum W^t e` have the
//! covariance `sum_kl rho(d_kl) W_k^t W_l` instead of `sum W^t W`: neighbours count by how much their rows
//! agree. How far errors correlate beyond the given length, and how large they are, is estimated from the
//! residuals: edges in depth correlate errors farther than windows do.

use crate::motion3d::kernels::{Weighted, add_to_rotation, depths, information, slopes};
use crate::motion3d::model::input::Flow;
use crate::motion3d::model::observations::{Observations, Row, SAMPLE};
use crate::motion3d::model::rows::{Matrix5, Vector5};
use crate::motion3d::solver::{covariance::inverse, refine::FEWER};
use crate::parallel;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// Share of correlation that falls off as windows stop sharing pixels, and the length, in correlation
/// lengths, of the rest: measured on residuals of a recorded drive. At four times that one hundredth is left.
const QUICK: f64 = 0.4;
const TAIL: f64 = 3.75;
/// Points of one task, each of which is compared with many others.
const POINTS_PER_TASK: usize = 16;

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
    let squares = information(inliers, at, 0.0);
    let residuals = depths(inliers, at.motion).e;
    let row = |k: usize| (slopes(inliers, at.motion, at.tangent, at.nu[k], k), residuals[k]);
    let excess = Neighbourhood::new(inliers, flow, length, row).correlation_excess(&inverse(&squares)?, inliers.own());
    let l = squares.cholesky()?.l();
    let back = l.try_inverse()?;
    let larger = Matrix5::identity() + of_positive(&(back * excess * back.transpose()), |size| size);
    let root = of_positive(&(l.transpose() * covariance * l), f64::sqrt);
    let out = (back.transpose() * root * larger * root * back).symmetric_part();
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
    add_to_rotation(&mut inverse, covariance, 1.0);
    let of_axis = |axis: usize| {
        let row = |k: usize| {
            let Row { r, f, .. } = inliers.row(k);
            let turn = r.row(axis);
            (Vector5::new(0.0, 0.0, turn[0], turn[1], turn[2]), f[axis] - (turn * w)[0])
        };
        Neighbourhood::new(inliers, flow, length, row).correlation_excess(&inverse, inliers.own())
    };
    let larger = inverse * of_positive(&(of_axis(0) + of_axis(1)), |size| size) * inverse;
    covariance + larger.fixed_view::<3, 3>(2, 2)
}

/// A function of the positive part of a symmetric matrix: correlation adds no information.
fn of_positive(matrix: &Matrix5, of: impl Fn(f64) -> f64) -> Matrix5 {
    let eigen = SymmetricEigen::new(matrix.symmetric_part());
    let sizes = eigen.eigenvalues.map(|size| of(size.max(0.0)));
    eigen.eigenvectors * Matrix5::from_diagonal(&sizes) * eigen.eigenvectors.transpose()
}

/// Residuals nearer than this many correlation lengths are compared: three times the usual distance of
/// points.
const NEAR: f64 = 6.0;

/// By how much the correlation length may be longer than given.
const STRETCHES: [f64; 10] = [1.15, 1.32, 1.52, 1.75, 2.0, 2.3, 2.65, 3.05, 3.5, 4.0];

/// The least share of the errors' variance that is left in residuals, for them to determine it.
const LEFT: f64 = 0.1;

/// A point as others see it.
struct Point {
    /// Where it was given, in correlation lengths.
    place: Vector3<f64>,
    /// `W`.
    row: Vector5,
    residual: f64,
}

/// Points from top to bottom, so that only a band of them is near one.
struct Neighbourhood {
    all: Vec<Point>,
}

/// What errors of unit variance that correlate make of the points.
struct Expected {
    /// `W^t R W`.
    sums: Matrix5,
    /// Squares of the residuals.
    squares: f64,
    /// Products of near residuals, in units of these.
    alike: f64,
}

impl Neighbourhood {
    /// `row`: `W` and the residual of a point.
    fn new(inliers: &Observations, flow: &Flow<'_>, length: f64, row: impl Fn(usize) -> (Vector5, f64)) -> Self {
        let point = |k: usize| {
            let (row, residual) = row(k);
            Point { place: flow.place(inliers.source[k] as usize) / length, row, residual }
        };
        let mut all: Vec<Point> = (0..inliers.n).map(point).collect();
        all.sort_by(|a, b| a.place.y.total_cmp(&b.place.y));
        Self { all }
    }

    /// What correlation adds to `sum W^t W`, less what the given noise has too much for each point's own
    /// where several share one error. `inverse`: that of the equations' information; `own`: the standard
    /// deviation of a point's own error.
    ///
    /// Fitting a motion takes what looks like one out of the residuals: of errors with the correlations `R`
    /// they have the covariance `(I - H) R (I - H)^t`, `H = W A^-1 W^t`. The shortest stretch is taken for
    /// which that makes residuals of neighbours as alike as they are.
    fn correlation_excess(&self, inverse: &Matrix5, own: f64) -> Matrix5 {
        let squares: f64 = self.all.iter().map(|point| point.residual.powi(2)).sum();
        let information: Matrix5 = self.all.iter().map(|point| point.row * point.row.transpose()).sum();
        let of_point = |k: usize| {
            let (mut rows, mut alike) = (Vector5::zeros(), 0.0);
            for (l, _) in self.around(k, NEAR).filter(|(_, distance)| *distance < NEAR) {
                rows += self.all[l].row;
                alike += self.all[k].residual * self.all[l].residual;
            }
            (rows, alike)
        };
        let of_points = parallel::map_range(self.all.len(), POINTS_PER_TASK, of_point);
        let (near, products): (Vec<Vector5>, Vec<f64>) = of_points.into_iter().unzip();
        let alike = products.iter().sum::<f64>() / squares;
        let expected_at = |stretch: f64| self.expected(&near, (inverse, &information), stretch);
        let mut expected = expected_at(1.0);
        for stretch in STRETCHES {
            let next = expected_at(stretch);
            // Longer ones look like a motion, and show in no residual.
            let is_better = expected.alike < alike && next.alike > expected.alike;
            if self.all.len() < SAMPLE || !is_better {
                break;
            }
            expected = next;
        }
        expected.sums * (squares / expected.squares).max(own * own) - information
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

    /// With `U = R W`, `B = W^t U` and the rows `N` of neighbours added up, the products of near residuals
    /// are `sum R - 2 tr A^-1 U^t N + tr A^-1 B A^-1 W^t N`, and the squares the same with `N = W`.
    fn expected(&self, near: &[Vector5], (inverse, information): (&Matrix5, &Matrix5), stretch: f64) -> Expected {
        // Rows of the other points times their correlations, and the correlations of the near ones added up.
        let of_point = |k: usize| {
            let (mut rows, mut correlations) = (Vector5::zeros(), 0.0);
            for (l, distance) in self.around(k, 4.0 * TAIL * stretch) {
                let rho = correlation(distance / stretch);
                rows += self.all[l].row * rho;
                correlations += if distance < NEAR { rho } else { 0.0 };
            }
            (rows * self.all[k].row.transpose(), rows * near[k].transpose(), correlations)
        };
        let count = self.all.len() as f64;
        // Of many points a regular subset stands for its neighbours.
        let step = self.all.len().div_ceil(FEWER).max(1);
        let chosen: Vec<usize> = (step / 2..self.all.len()).step_by(step).collect();
        let each = count / chosen.len().max(1) as f64;
        // Added up in one order, whoever computed them.
        let parts: Vec<(Matrix5, Matrix5, f64)> =
            parallel::map_range(chosen.len(), POINTS_PER_TASK, |k| of_point(chosen[k]));
        let products: Matrix5 = self.all.iter().zip(near).map(|(point, near)| point.row * near.transpose()).sum();
        let sums = information + parts.iter().map(|(own, ..)| own).sum::<Matrix5>() * each;
        let with_near = products + parts.iter().map(|(_, near, _)| near).sum::<Matrix5>() * each;
        let correlations = parts.iter().map(|(.., correlations)| correlations).sum::<f64>() * each;
        let middle = inverse * sums * inverse;
        let squares = count - 2.0 * (inverse * sums).trace() + (middle * information).trace();
        let squares = squares.max(LEFT * count);
        let alike = correlations - 2.0 * (inverse * with_near).trace() + (middle * products).trace();
        Expected { sums, squares, alike: alike / squares }
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
