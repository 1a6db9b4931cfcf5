//! Estimates put in their places.

use super::point::PointEstimate;
use crate::flow::site::FieldBand;
use crate::math::Real;
use crate::types::Status;

/// NaN everywhere, with a reason.
pub(super) fn clear<T: Real>(band: &mut FieldBand<'_, T>, local: usize, status: Status) {
    for plane in band.motion.iter_mut().chain(&mut band.covariance) {
        plane[local] = T::nan();
    }
    band.status[local] = status;
    if let Some(p) = &mut band.residual {
        p[local] = T::nan();
    }
    if let Some(p) = &mut band.condition {
        p[local] = T::nan();
    }
    if let Some(p) = &mut band.rank {
        p[local] = 0;
    }
}

/// Puts an estimate in its place.
pub(super) fn write<T: Real>(band: &mut FieldBand<'_, T>, local: usize, estimate: &PointEstimate) {
    for (plane, value) in band.motion.iter_mut().zip(estimate.values) {
        plane[local] = T::from_f64(value);
    }
    let p = band.motion.len();
    let pairs = (0..p).flat_map(|i| (i..p).map(move |j| (i, j)));
    for (plane, (i, j)) in band.covariance.iter_mut().zip(pairs) {
        plane[local] = T::from_f64(estimate.covariance[i][j]);
    }
    band.status[local] = estimate.status;
    if let Some(plane) = &mut band.residual {
        plane[local] = T::from_f64(estimate.residual);
    }
    if let Some(plane) = &mut band.condition {
        plane[local] = T::from_f64(estimate.condition);
    }
    if let Some(plane) = &mut band.rank {
        plane[local] = estimate.rank;
    }
}
