//! A steady affine velocity field.

use super::{Motion, PointMap};
use crate::types::AffineFlow;
use nalgebra::Matrix3;

/// `u(p) = (u, v) + M (p - c)`, the same at every time: translation, rotation, expansion and shear in any
/// mixture.
///
/// Particle paths are `p(t) = exp(t G) p(0)` with the 3 x 3 generator `G = [[M, (u, v) - M c], [0, 0]]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AffineField {
    /// Velocity at the centre and its Jacobian.
    pub at_centre: AffineFlow<f64>,
    /// The centre `c`, px.
    pub centre: (f64, f64),
}

impl AffineField {
    /// Velocity and Jacobian `(u, v, u_x, v_x, u_y, v_y)` at `centre`.
    pub fn new(motion: [f64; 6], centre: (f64, f64)) -> Self {
        Self { at_centre: AffineFlow::from_array(motion), centre }
    }

    /// Rotation by `angular_velocity` rad/frame (from x to y, clockwise on the screen) about `centre`.
    pub fn rotation(angular_velocity: f64, centre: (f64, f64)) -> Self {
        Self::new([0.0, 0.0, 0.0, angular_velocity, -angular_velocity, 0.0], centre)
    }
}

impl Motion for AffineField {
    fn velocity(&self, x: f64, y: f64, _t: f64) -> AffineFlow<f64> {
        let (u, v) = self.at_centre.at_offset(x - self.centre.0, y - self.centre.1);
        AffineFlow { u, v, ..self.at_centre }
    }

    fn path_map(&self, from: f64, to: f64) -> PointMap<'_> {
        let m = self.at_centre;
        let generator = Matrix3::new(m.u_x, m.u_y, m.u, m.v_x, m.v_y, m.v, 0.0, 0.0, 0.0);
        let e = (generator * (to - from)).exp();
        let (cx, cy) = self.centre;
        Box::new(move |x, y| {
            let (dx, dy) = (x - cx, y - cy);
            (cx + e[(0, 0)] * dx + e[(0, 1)] * dy + e[(0, 2)], cy + e[(1, 0)] * dx + e[(1, 1)] * dy + e[(1, 2)])
        })
    }
}
