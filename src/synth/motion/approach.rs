//! What a camera sees of a surface that it runs into.

use super::{Motion, PointMap};
use crate::types::AffineFlow;

/// A fronto-parallel surface at distance `Z(t) = Z0 (1 - t / tau)`: `u = (x - x0) / (tau - t)`, `v = (y - y0)
/// / (tau - t)`.
///
/// `tau` is the time to contact at time 0, so the truth at time t is `tau - t = 2 / divergence`. A negative
/// `tau` is a surface drawing away. From the moment of contact on there is no picture: velocity and paths are
/// NaN.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Approach {
    /// Frames until contact, counted from time 0.
    pub time_to_contact: f64,
    /// The point `(x0, y0)` that stays where it is, px.
    pub focus_of_expansion: (f64, f64),
}

impl Approach {
    /// Frames left until contact at time `t`; NaN once it has happened.
    pub fn time_left(&self, t: f64) -> f64 {
        let left = self.time_to_contact - t;
        if left * self.time_to_contact > 0.0 { left } else { f64::NAN }
    }
}

impl Motion for Approach {
    fn velocity(&self, x: f64, y: f64, t: f64) -> AffineFlow<f64> {
        let rate = 1.0 / self.time_left(t);
        let (x0, y0) = self.focus_of_expansion;
        AffineFlow { u: rate * (x - x0), v: rate * (y - y0), u_x: rate, v_x: 0.0, u_y: 0.0, v_y: rate }
    }

    fn path_map(&self, from: f64, to: f64) -> PointMap<'_> {
        let scale = self.time_left(from) / self.time_left(to);
        let (x0, y0) = self.focus_of_expansion;
        Box::new(move |x, y| (x0 + scale * (x - x0), y0 + scale * (y - y0)))
    }
}
