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
use integrate::integrate;

/// A map of the plane, prepared once for a time.
pub type PointMap<'a> = Box<dyn Fn(f64, f64) -> (f64, f64) + Send + Sync + 'a>;

/// A velocity field together with the map of its particle paths.
pub trait Motion: Send + Sync {
    /// Velocity and its Jacobian at the point `(x, y)` px and time `t` frames; px/frame and 1/frame.
    fn velocity(&self, x: f64, y: f64, t: f64) -> AffineFlow<f64>;

    /// The map that takes matter from its place at time `from` to its place at time `to`.
    fn path_map(&self, from: f64, to: f64) -> PointMap<'_>;

    /// Velocity and its Jacobian where they are finite, as a scene tells its truth.
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
}

/// Shared checks: each motion's velocity, Jacobian and paths must tell the same story.
#[cfg(test)]
pub(super) mod conformance {
    use super::Motion;

    /// Points near which the checks are made.
    const POINTS: [(f64, f64); 5] = [(3.0, -2.0), (20.5, 11.0), (31.0, 33.0), (-14.0, 40.2), (32.0, 31.5)];

    pub fn check(motion: &dyn Motion, tolerance: f64) {
        for (x, y) in POINTS {
            for t in [0.0, 0.7, 3.0] {
                jacobian_is_the_derivative(motion, x, y, t, tolerance);
                paths_follow_the_velocity(motion, x, y, t, tolerance);
                paths_go_back(motion, x, y, t, tolerance);
            }
        }
    }

    fn jacobian_is_the_derivative(motion: &dyn Motion, x: f64, y: f64, t: f64, tolerance: f64) {
        let h = 1e-4;
        let m = motion.velocity(x, y, t);
        let slope = |a: crate::types::AffineFlow<f64>, b: crate::types::AffineFlow<f64>| {
            ((a.u - b.u) / (2.0 * h), (a.v - b.v) / (2.0 * h))
        };
        let along_x = slope(motion.velocity(x + h, y, t), motion.velocity(x - h, y, t));
        let along_y = slope(motion.velocity(x, y + h, t), motion.velocity(x, y - h, t));
        for (got, want) in [(m.u_x, along_x.0), (m.v_x, along_x.1), (m.u_y, along_y.0), (m.v_y, along_y.1)] {
            assert!((got - want).abs() < tolerance, "Jacobian at ({x}, {y}), t = {t}: {got} against {want}");
        }
    }

    fn paths_follow_the_velocity(motion: &dyn Motion, x: f64, y: f64, t: f64, tolerance: f64) {
        let h = 1e-3;
        let m = motion.velocity(x, y, t);
        let (ahead, behind) = (motion.path_map(t, t + h)(x, y), motion.path_map(t, t - h)(x, y));
        let (u, v) = ((ahead.0 - behind.0) / (2.0 * h), (ahead.1 - behind.1) / (2.0 * h));
        assert!((u - m.u).abs() < tolerance && (v - m.v).abs() < tolerance, "({x}, {y}), t = {t}: ({u}, {v}), {m:?}");
    }

    fn paths_go_back(motion: &dyn Motion, x: f64, y: f64, t: f64, tolerance: f64) {
        let (there_x, there_y) = motion.path_map(t, t + 4.0)(x, y);
        let (back_x, back_y) = motion.path_map(t + 4.0, t)(there_x, there_y);
        assert!((back_x - x).abs() < tolerance && (back_y - y).abs() < tolerance, "({x}, {y}), t = {t}");
    }
}
