//! Flow that is too short or too long by one factor all over the picture.
//!
//! With `f`, depths and `w` times `1 + b` all residuals stay, so that none tells `b`, and the direction is the same: a camera's rotation is off by `b w`. Flow from gradients errs like that: noise in the gradients makes it too short (J. Kearney, W. Thompson, D. Boley 1987; C. Fermueller, D. Shulman, Y. Aloimonos 2001), displacements that are not small beside the texture make it too long or too short, alike wherever the texture is.
//! A field's covariance has it in it, as it has the whole error of a point, but no mean over points makes it smaller.

use super::covariance::Matrix5;
use super::motion::Motion;
use super::observations::{Known, median};
use nalgebra::{Matrix2, SVector, Vector2};

/// How far the scale of flow may be off, as far as its covariances tell: by what would be the whole error of half the points. Of each, its flow and the covariance of that.
pub(super) fn told(points: impl Iterator<Item = (Vector2<f64>, Matrix2<f64>)>) -> f64 {
    let square =
        |(flow, covariance): (Vector2<f64>, Matrix2<f64>)| Some(flow.dot(&covariance.cholesky()?.solve(&flow)));
    let mut squares: Vec<f64> = points.filter_map(square).filter(|square| square.is_finite()).collect();
    let median = median(&mut squares);
    // An error has two components. Flow that may be twice as long or none has no scale.
    if median > 0.0 { (2.0 / median).sqrt().min(1.0) } else { 1.0 }
}

/// What a scale of that deviation adds to the covariance of a motion: `(0, w) b`, less what is known beforehand of the rotation.
pub(super) fn added(covariance: &Matrix5, motion: &Motion, known: Option<&Known>, deviation: f64) -> Matrix5 {
    let w = motion.w();
    let mut moved = SVector::<f64, 5>::new(0.0, 0.0, w.x, w.y, w.z);
    if let Some(known) = known {
        moved -= covariance.fixed_columns::<3>(2) * (known.information * w);
    }
    moved * moved.transpose() * (deviation * deviation)
}
