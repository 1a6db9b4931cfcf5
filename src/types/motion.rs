//! The affine motion of one point.

use crate::math::Real;

/// Names of the six motion parameters, in their order everywhere in this crate.
pub const MOTION_NAMES: [&str; 6] = ["u", "v", "u_x", "v_x", "u_y", "v_y"];

/// Flow and its Jacobian at one point: `m = (u, v, u_x, v_x, u_y, v_y)`, in this order.
///
/// `u`, `v` in px/frame along x (right) and y (down); derivatives in 1/frame. The flow near the point is
/// `(u, v) + M (dx, dy)` with `M = [[u_x, u_y], [v_x, v_y]]`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AffineFlow<T> {
    /// Flow along x, px/frame.
    pub u: T,
    /// Flow along y, px/frame.
    pub v: T,
    /// du/dx, 1/frame.
    pub u_x: T,
    /// dv/dx, 1/frame.
    pub v_x: T,
    /// du/dy, 1/frame.
    pub u_y: T,
    /// dv/dy, 1/frame.
    pub v_y: T,
}

impl<T: Real> AffineFlow<T> {
    /// From `(u, v, u_x, v_x, u_y, v_y)`.
    pub fn from_array([u, v, u_x, v_x, u_y, v_y]: [T; 6]) -> Self {
        Self { u, v, u_x, v_x, u_y, v_y }
    }
    /// As `(u, v, u_x, v_x, u_y, v_y)`.
    pub fn to_array(self) -> [T; 6] {
        [self.u, self.v, self.u_x, self.v_x, self.u_y, self.v_y]
    }
    /// Velocity at an offset `(dx, dy)` px from the point: `(u, v) + M (dx, dy)`.
    pub fn at_offset(self, dx: T, dy: T) -> (T, T) {
        (self.u + self.u_x * dx + self.u_y * dy, self.v + self.v_x * dx + self.v_y * dy)
    }
}
