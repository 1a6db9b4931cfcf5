//! Velocity fields whose particle paths are known in closed form.

mod affine;
mod approach;
mod integrate;
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

use crate::types::AffineFlow;
use integrate::{integrate, max_duration};

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
