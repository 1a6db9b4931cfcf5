//! A turning disc on a ground at rest.

use super::Scene;
use super::motion::{AffineField, Motion};
use super::scene::render;
use super::texture::{Texture, smooth_step};
use crate::types::{AffineFlow, Frame};
use std::f64::consts::TAU;

/// Half the width over which disc and ground are blended, px: what a pixel's own area would do.
const BLEND: f64 = 0.5;

/// A textured disc turning at a constant angular velocity before a textured ground at rest.
///
/// The truth is `u = -w (y - y_c)`, `v = w (x - x_c)` inside, zero outside, none within `rim` px.
#[derive(Debug, Clone)]
pub struct RotatingDisc<X> {
    /// `(width, height)` of a frame, px.
    pub size: (usize, usize),
    /// Scene coordinates of pixel (0, 0), px.
    pub origin: (f64, f64),
    /// Centre of the disc, px.
    pub centre: (f64, f64),
    /// Radius of the disc, px.
    pub radius: f64,
    /// Distance from the edge within which there is no truth, px; at least 1.
    pub rim: f64,
    /// Angular velocity `w`, rad/frame, from x to y (clockwise on the screen).
    pub angular_velocity: f64,
    /// Brightness of the disc at time 0.
    pub disc: X,
    /// Brightness of the ground.
    pub ground: X,
}

/// Angular velocity in rad/frame of `rpm` turns a minute filmed at `fps` frames a second.
pub fn radians_per_frame(rpm: f64, fps: f64) -> f64 {
    TAU * rpm / 60.0 / fps
}

impl<X: Texture> RotatingDisc<X> {
    fn turning(&self) -> AffineField {
        AffineField::rotation(self.angular_velocity, self.centre)
    }

    fn look(&self, x: f64, y: f64, back: impl Fn(f64, f64) -> (f64, f64)) -> f64 {
        let distance = (x - self.centre.0).hypot(y - self.centre.1) - self.radius;
        let share = 1.0 - smooth_step((distance + BLEND) / (2.0 * BLEND));
        let inside = if share > 0.0 {
            let (source_x, source_y) = back(x, y);
            share * self.disc.value(source_x, source_y)
        } else {
            0.0
        };
        let outside = if share < 1.0 { (1.0 - share) * self.ground.value(x, y) } else { 0.0 };
        inside + outside
    }
}

impl<X: Texture> Scene for RotatingDisc<X> {
    fn size(&self) -> (usize, usize) {
        self.size
    }
    fn origin(&self) -> (f64, f64) {
        self.origin
    }
    fn brightness(&self, x: f64, y: f64, t: f64) -> f64 {
        let turning = self.turning();
        self.look(x, y, turning.path_map(t, 0.0))
    }
    fn motion(&self, x: f64, y: f64, t: f64) -> Option<AffineFlow<f64>> {
        let distance = (x - self.centre.0).hypot(y - self.centre.1) - self.radius;
        let rim = self.rim.max(1.0);
        if distance < -rim {
            Some(self.turning().velocity(x, y, t))
        } else {
            (distance > rim).then(AffineFlow::default)
        }
    }
    fn displacement(&self, x: f64, y: f64, t: f64, duration: f64) -> Option<(f64, f64)> {
        let motion = self.motion(x, y, t)?;
        if motion.v_x == 0.0 {
            return Some((0.0, 0.0));
        }
        let (there_x, there_y) = self.turning().path_map(t, t + duration)(x, y);
        Some((there_x - x, there_y - y))
    }
    fn frame(&self, t: f64) -> Frame<f64> {
        let turning = self.turning();
        let back = turning.path_map(t, 0.0);
        let origin = self.origin;
        render(self.size, |column, row| self.look(origin.0 + column as f64, origin.1 + row as f64, &back))
    }
}
