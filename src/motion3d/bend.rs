//! What the bend of a valley adds to a covariance.
//!
//! Along the direction that is known least the other unknowns do not follow a straight line: where the direction is off by `psi`, they are off by `slope psi + c psi^2` with the other unknowns' deviations from it small. The covariance has the line; of a normal
//! `psi` with the variance `l`, the rest has the mean square `3 c^2 l^2`.
//!
//! Where the direction is known to a large share of the field only, more than the bend is not linear: depths in the weights, and their noise, differ along the valley. What that adds across the valley has been measured; it grows as the square of the share, as terms of second order do.

use super::covariance::{Matrix5, direction_block, direction_deviation, direction_spread, inverse};
use super::kernels::Bilinear;
use super::motion::Motion;
use super::observations::Observations;
use nalgebra::{Matrix2x3, SMatrix, SymmetricEigen};

/// Deviation of the direction, degrees, below which a valley is straight.
const STRAIGHT: f64 = 1.0;

/// Mean fourth power of a normal variable of variance 1.
const KURTOSIS: f64 = 3.0;

/// Most steps towards the valley's floor, and the length of one that is the last, rad.
const STEPS: usize = 15;
const STEP: f64 = 1e-9;

/// What is added to the variance across the valley, in squares of the direction's deviation relative to the field, and the largest share that this was measured for: with it ellipsoids of fields of 17 to 90 degrees, of 30 to 400 points with 1 to 10 % of noise, hold the truth as often whatever the share.
const ACROSS: f64 = 8.0;
const LARGEST: f64 = 0.8;

type Vector4 = SMatrix<f64, 4, 1>;
type Vector5 = SMatrix<f64, 5, 1>;

/// The covariance of a solution of the estimating equation with the depths `nu` in its weights, with what the bend adds; the same where the equation has no solution beside it.
pub(super) fn bent(
    covariance: &Matrix5,
    observations: &Observations,
    motion: &Motion,
    tangent: &Matrix2x3<f64>,
    nu: &[f64],
) -> Matrix5 {
    let deviation = direction_deviation(covariance);
    if !(deviation.is_finite() && deviation > STRAIGHT) {
        return *covariance;
    }
    let eigen = SymmetricEigen::new(direction_block(covariance));
    let most = eigen.eigenvalues.imax();
    // Axes with the direction that is known least first.
    let mut axes = eigen.eigenvectors.transpose();
    if most == 1 {
        axes.swap_rows(0, 1);
    }
    let along = axes * tangent;
    let equation = Bilinear::new(observations, motion, &along, nu, direction_spread(covariance));
    let step = eigen.eigenvalues[most].sqrt();
    let floor = |psi: f64| floor(&equation, motion, &along, psi);
    let (Some(ahead), Some(here), Some(behind)) = (floor(step), floor(0.0), floor(-step)) else {
        return *covariance;
    };
    let bend = (ahead + behind) * 0.5 - here;
    let mut rest = Vector5::zeros();
    rest.fixed_rows_mut::<4>(1).copy_from(&bend);
    let mut into = Matrix5::identity();
    into.fixed_view_mut::<2, 2>(0, 0).copy_from(&axes.transpose());
    let rest = into * rest;
    let out = covariance + rest * rest.transpose() * KURTOSIS;
    if inverse(&out).is_some() { out } else { *covariance }
}

/// The covariance with what a narrow field adds across the valley; the variance of the direction that is known least stays. A rotation that is known beforehand leaves no valley.
pub(super) fn narrowed(covariance: &Matrix5, observations: &Observations) -> Matrix5 {
    let share = direction_deviation(covariance).to_radians() / spread(&observations.site);
    if observations.prior.is_some() || !share.is_finite() {
        return *covariance;
    }
    let eigen = SymmetricEigen::new(direction_block(covariance));
    let most = eigen.eigenvalues.imax();
    let along = covariance.fixed_columns::<2>(0) * eigen.eigenvectors.column(most);
    let valley = along * along.transpose() / eigen.eigenvalues[most];
    valley + (covariance - valley) * (1.0 + ACROSS * share.min(LARGEST).powi(2))
}

/// Root mean square distance of points from their middle.
fn spread(points: &[[f64; 3]]) -> f64 {
    let n = points.len().max(1) as f64;
    let mean = |of: &dyn Fn(&[f64; 3]) -> f64| points.iter().map(of).sum::<f64>() / n;
    let square: f64 = (0..3).map(|axis| mean(&|at| at[axis] * at[axis]) - mean(&|at| at[axis]).powi(2)).sum();
    square.max(0.0).sqrt()
}

/// The other unknowns that solve their equations where the direction is off by `psi` along the first axis.
fn floor(equation: &Bilinear, motion: &Motion, axes: &Matrix2x3<f64>, psi: f64) -> Option<Vector4> {
    let mut rest = Vector4::zeros();
    for _ in 0..STEPS {
        let off = Vector5::new(psi, rest[0], rest[1], rest[2], rest[3]);
        let at = motion.stepped(axes, &off);
        let (value, slope) = equation.at(&at, axes);
        let slope = slope.fixed_view::<4, 4>(1, 1).into_owned();
        let change = slope.lu().solve(&-value.fixed_rows::<4>(1).into_owned())?;
        if !change.iter().all(|value| value.is_finite()) {
            return None;
        }
        rest += change;
        if change.norm() < STEP {
            return Some(rest);
        }
    }
    None
}
