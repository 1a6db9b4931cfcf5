//! Velocity fields with the paths of their particles, known in closed form or integrated.

mod affine;
mod approach;
mod shear;
mod turbulence;
mod vortex;
mod waves;

pub use affine::AffineField;
pub use approach::Approach;
pub use shear::SinusoidalShear;
pub use turbulence::Turbulence;
pub use vortex::LambOseen;
pub use waves::Waves;

use crate::parallel::checkpoint;
use crate::types::AffineFlow;

/// A map of the plane, prepared once for a time.
pub type PointMap<'a> = Box<dyn Fn(f64, f64) -> (f64, f64) + Send + Sync + 'a>;

/// A velocity field together with the map of its particle paths.
pub trait Motion: Send + Sync {
    /// Velocity and its Jacobian at the point `(x, y)` px and time `t` frames; px/frame and 1/frame.
    fn velocity(&self, x: f64, y: f64, t: f64) -> AffineFlow<f64>;

    /// The map that takes matter from its place at time `from` to its place at time `to`.
    fn path_map(&self, from: f64, to: f64) -> PointMap<'_>;

    /// Longest time, frames, over which paths are followed: finite where they are integrated step by step.
    fn max_duration(&self) -> f64 {
        f64::INFINITY
    }

    /// Velocity and its Jacobian where they are finite, as the truth of a scene.
    fn truth(&self, x: f64, y: f64, t: f64) -> Option<AffineFlow<f64>> {
        let motion = self.velocity(x, y, t);
        motion.to_array().iter().all(|value| value.is_finite()).then_some(motion)
    }

    /// How far the matter at `(x, y)` at time `t` has gone `duration` frames later, px.
    fn displacement(&self, x: f64, y: f64, t: f64, duration: f64) -> (f64, f64) {
        let (there_x, there_y) = self.path_map(t, t + duration)(x, y);
        (there_x - x, there_y - y)
    }
}

impl<M: Motion + ?Sized> Motion for Box<M> {
    fn velocity(&self, x: f64, y: f64, t: f64) -> AffineFlow<f64> {
        (**self).velocity(x, y, t)
    }
    fn path_map(&self, from: f64, to: f64) -> PointMap<'_> {
        (**self).path_map(from, to)
    }
    fn max_duration(&self) -> f64 {
        (**self).max_duration()
    }
}

/// Maximum number of steps along one path, so that no call runs for hours.
const MAX_STEPS: f64 = 1e5;

/// Longest duration of [`integrate`], frames.
fn max_duration(steps_per_frame: f64) -> f64 {
    (MAX_STEPS / steps_per_frame).floor()
}

/// The map along the paths of a steady field `velocity` without a closed form, for `duration` frames:
/// Runge-Kutta. NaN beyond [`max_duration`].
fn integrate<'a>(
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
