//! The reference scene of the patent: a brightness ramp turning about the origin.

use super::Scene;
use crate::types::AffineFlow;
use std::f64::consts::PI;

/// `I(x, y, t) = beta (x cos wt + y sin wt) + I0` (WO2010/098160, (45)), the scene whose Hessian vanishes
/// everywhere.
///
/// Truth (46): `u = -w y`, `v = w x`, `u_y = -w`, `v_x = w`, `u_x = v_y = 0`, at every time. The scene is an
/// unbounded plane; `origin` and the size choose the window that frames show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RotatingRamp {
    /// Columns of a frame, px.
    pub width: usize,
    /// Rows of a frame, px.
    pub height: usize,
    /// Scene coordinates of pixel (0, 0), px. The centre of rotation is the scene's (0, 0).
    pub origin: (f64, f64),
    /// Slope of the ramp, grey levels/px.
    pub slope: f64,
    /// Angular velocity `w`, rad/frame, from x to y (clockwise on the screen).
    pub angular_velocity: f64,
    /// Brightness `I0` at the centre of rotation, grey levels.
    pub offset: f64,
}

impl RotatingRamp {
    /// The patent's settings, beta = 0.2, w = pi/100 (400 frames are two turns), I0 = 128.
    pub fn reference(width: usize, height: usize) -> Self {
        Self { width, height, origin: (0.0, 0.0), slope: 0.2, angular_velocity: PI / 100.0, offset: 128.0 }
    }

    /// The same scene through a window whose pixel (0, 0) is the scene point `origin`.
    pub fn with_origin(self, origin: (f64, f64)) -> Self {
        Self { origin, ..self }
    }

    /// The same scene through a window whose pixel `(width / 2, height / 2)` is the scene point `(x, y)`.
    pub fn centred_at(self, x: f64, y: f64) -> Self {
        self.with_origin((x - (self.width / 2) as f64, y - (self.height / 2) as f64))
    }
}

impl Scene for RotatingRamp {
    fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }
    fn origin(&self) -> (f64, f64) {
        self.origin
    }
    fn brightness(&self, x: f64, y: f64, t: f64) -> f64 {
        let (sine, cosine) = (self.angular_velocity * t).sin_cos();
        self.slope * (x * cosine + y * sine) + self.offset
    }
    fn motion(&self, x: f64, y: f64, _t: f64) -> Option<AffineFlow<f64>> {
        let w = self.angular_velocity;
        Some(AffineFlow { u: -w * y, v: w * x, u_x: 0.0, v_x: w, u_y: -w, v_y: 0.0 })
    }
    fn displacement(&self, x: f64, y: f64, _t: f64, duration: f64) -> Option<(f64, f64)> {
        let (sine, cosine) = (self.angular_velocity * duration).sin_cos();
        Some((x * cosine - y * sine - x, x * sine + y * cosine - y))
    }
}
