//! Particle paths of steady fields without a closed form.

use super::PointMap;
use crate::parallel::checkpoint;

/// Maximum number of steps along one path, so that no call runs for hours.
const MAX_STEPS: f64 = 1e5;

/// Longest duration of [`integrate`], frames.
pub(super) fn max_duration(steps_per_frame: f64) -> f64 {
    (MAX_STEPS / steps_per_frame).floor()
}

/// The map along the paths of the steady field `velocity` for `duration` frames: Runge-Kutta. NaN beyond
/// [`max_duration`].
pub(super) fn integrate<'a>(
    velocity: impl Fn(f64, f64) -> (f64, f64) + Send + Sync + 'a,
    duration: f64,
    steps_per_frame: f64,
) -> PointMap<'a> {
    if duration.is_nan() || duration.abs() > max_duration(steps_per_frame) {
        return Box::new(|_, _| (f64::NAN, f64::NAN));
    }
    let steps = (duration.abs() * steps_per_frame).ceil();
    let h = if steps > 0.0 { duration / steps } else { 0.0 };
    Box::new(move |mut x, mut y| {
        for _ in 0..steps as usize {
            checkpoint();
            let (a_u, a_v) = velocity(x, y);
            let (b_u, b_v) = velocity(x + 0.5 * h * a_u, y + 0.5 * h * a_v);
            let (c_u, c_v) = velocity(x + 0.5 * h * b_u, y + 0.5 * h * b_v);
            let (d_u, d_v) = velocity(x + h * c_u, y + h * c_v);
            x += h / 6.0 * (a_u + 2.0 * b_u + 2.0 * c_u + d_u);
            y += h / 6.0 * (a_v + 2.0 * b_v + 2.0 * c_v + d_v);
        }
        (x, y)
    })
}
