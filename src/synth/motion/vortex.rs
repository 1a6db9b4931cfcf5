//! A viscous vortex.

use super::{Motion, PointMap};
use crate::types::AffineFlow;
use std::f64::consts::TAU;

/// The Lamb-Oseen vortex with a core that keeps its size: `v_theta(r) = circulation / (2 pi r) (1 - exp(-r^2
/// / core^2))`.
///
/// Turning is from x to y (clockwise on the screen) for a positive circulation. The centre may drift; seen
/// from it every path is a circle run through at a known angular velocity, so positions at any time are
/// exact. (H. Lamb, Hydrodynamics, 1932; C. W. Oseen, 1912.)
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LambOseen {
    /// Circulation far from the core, px^2/frame.
    pub circulation: f64,
    /// Core radius, px.
    pub core: f64,
    /// The centre at time 0, px.
    pub centre: (f64, f64),
    /// Velocity at which the whole vortex drifts, px/frame.
    pub drift: (f64, f64),
}

impl LambOseen {
    /// Where the centre is at time `t`.
    pub fn centre_at(&self, t: f64) -> (f64, f64) {
        (self.centre.0 + self.drift.0 * t, self.centre.1 + self.drift.1 * t)
    }

    /// Angular velocity at squared distance `s` from the centre, rad/frame, and its derivative by `s`.
    fn angular_velocity(&self, s: f64) -> (f64, f64) {
        let area = self.core * self.core;
        let strength = self.circulation / (TAU * area);
        let z = s / area;
        let mean = if z < 1e-12 { 1.0 } else { -(-z).exp_m1() / z };
        // (exp(-z) (1 + z) - 1) / z^2 cancels near 0; its power series does not.
        let slope = if z < 0.05 {
            let terms = [-1.0 / 2.0, 1.0 / 3.0, -1.0 / 8.0, 1.0 / 30.0, -1.0 / 144.0, 1.0 / 840.0, -1.0 / 5760.0];
            terms.iter().rev().fold(0.0, |sum, term| sum * z + term)
        } else {
            ((-z).exp() * (1.0 + z) - 1.0) / (z * z)
        };
        (strength * mean, strength / area * slope)
    }

    /// Vorticity `v_x - u_y` at the point `(x, y)` and time `t`, 1/frame: `circulation / (pi core^2) exp(-r^2
    /// / core^2)`.
    pub fn vorticity(&self, x: f64, y: f64, t: f64) -> f64 {
        let (cx, cy) = self.centre_at(t);
        let area = self.core * self.core;
        let s = (x - cx).powi(2) + (y - cy).powi(2);
        2.0 * self.circulation / (TAU * area) * (-s / area).exp()
    }
}

impl Motion for LambOseen {
    fn velocity(&self, x: f64, y: f64, t: f64) -> AffineFlow<f64> {
        let (cx, cy) = self.centre_at(t);
        let (dx, dy) = (x - cx, y - cy);
        let (w, slope) = self.angular_velocity(dx * dx + dy * dy);
        AffineFlow {
            u: self.drift.0 - w * dy,
            v: self.drift.1 + w * dx,
            u_x: -2.0 * slope * dx * dy,
            v_x: w + 2.0 * slope * dx * dx,
            u_y: -w - 2.0 * slope * dy * dy,
            v_y: 2.0 * slope * dx * dy,
        }
    }

    fn path_map(&self, from: f64, to: f64) -> PointMap<'_> {
        let ((x0, y0), (x1, y1)) = (self.centre_at(from), self.centre_at(to));
        Box::new(move |x, y| {
            let (dx, dy) = (x - x0, y - y0);
            let (w, _) = self.angular_velocity(dx * dx + dy * dy);
            let (sine, cosine) = (w * (to - from)).sin_cos();
            (x1 + cosine * dx - sine * dy, y1 + sine * dx + cosine * dy)
        })
    }
}
