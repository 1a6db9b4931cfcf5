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
    /// The patent's settings, beta = 0.2, w = pi/100 (400 frames are two turns), I0 = 128, seen from scene
    /// point (0, 0) on.
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
    fn name(&self) -> &'static str {
        "ramp"
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flow_at_the_reference_pixel() {
        let scene = RotatingRamp::reference(64, 64).centred_at(60.0, 80.0);
        assert_eq!((scene.origin.0 + 32.0, scene.origin.1 + 32.0), (60.0, 80.0));
        let m = scene.motion(60.0, 80.0, 7.0).unwrap();
        assert!((m.u + 2.513274).abs() < 1e-6 && (m.v - 1.884956).abs() < 1e-6);
        assert_eq!((m.v_x, m.u_y), (PI / 100.0, -PI / 100.0));
    }

    #[test]
    fn four_hundred_frames_are_two_turns() {
        let scene = RotatingRamp::reference(8, 8);
        let (first, last) = (scene.frame(0.0), scene.frame(400.0));
        assert!(first.data().iter().zip(last.data()).all(|(a, b)| (a - b).abs() < 1e-10));
        assert_eq!(first.get(3, 5), 128.0 + 0.2 * 3.0);
    }

    #[test]
    fn brightness_is_carried_along() {
        let scene = RotatingRamp::reference(8, 8);
        let (dx, dy) = scene.displacement(60.0, 80.0, 3.0, 2.5).unwrap();
        let (before, after) = (scene.brightness(60.0, 80.0, 3.0), scene.brightness(60.0 + dx, 80.0 + dy, 5.5));
        assert!((before - after).abs() < 1e-12);
    }
}
