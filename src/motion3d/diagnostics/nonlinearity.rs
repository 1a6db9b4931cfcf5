//! How far maximum likelihood may be from the truth where its theory does not hold.
//!
//! (17) is linear in the noise of each depth, whose variance grows as `1 / s^2` towards the epipole: where
//! that may lie among the points, the lowest of many ripples is found, which is farther off than (17) has it.
//! The smoothed weights have no ripples. So what is known of the error then is the distance from their
//! solution, and the covariance of that.

use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::solver::covariance::{Matrix5, Plugged, direction_deviation};
use crate::motion3d::solver::efficient::Efficient;
use crate::motion3d::solver::refine::Minimum;
use nalgebra::{Matrix2, SMatrix, Vector2};

/// By how much the deviation of (17) must be above the bound's for the noise of the depths to matter.
const NOISY: f64 = 1.3;

/// Deviations of the direction within which the epipole may lie.
const REACH: f64 = 3.0;

/// Whether (17) cannot be trusted: the noise of the depths matters, and the epipole may lie among the points.
pub(crate) fn beyond_theory(observations: &Observations, minimum: &Minimum, plugged: &Plugged) -> bool {
    let deviation = direction_deviation(&plugged.likelihood);
    if deviation < NOISY * direction_deviation(&plugged.bound) {
        return false;
    }
    among(observations, &minimum.motion, deviation)
}

/// Whether the epipole may lie among the points, of a direction known to `deviation` degrees.
pub(crate) fn among(observations: &Observations, motion: &Motion, deviation: f64) -> bool {
    let reach = (REACH * deviation.to_radians()).powi(2);
    let u = motion.u();
    // On average over its two rows, |G u| is |G| / sqrt 2 for a u across the line of sight.
    (0..observations.n).any(|k| {
        let g = observations.row(k).g;
        (g * u).norm_squared() < reach * 0.5 * g.norm_squared()
    })
}

/// Mean square error of the minimum as the better solution has it, `C + d d^t` with their difference `d`, in
/// the minimum's axes.
pub(crate) fn departure(minimum: &Minimum, better: &Efficient) -> Matrix5 {
    let along: Vector2<f64> = minimum.tangent * better.motion.u();
    let turn = better.motion.w() - minimum.motion.w();
    let apart = SMatrix::<f64, 5, 1>::from_column_slice(&[along.x, along.y, turn.x, turn.y, turn.z]);
    let axes: Matrix2<f64> = minimum.tangent * better.tangent.transpose();
    let mut into = Matrix5::identity();
    into.fixed_view_mut::<2, 2>(0, 0).copy_from(&axes);
    let error = into * better.covariance * into.transpose() + apart * apart.transpose();
    0.5 * (error + error.transpose())
}
