//! Layers sliding over each other.

use super::{Motion, PointMap};
use crate::types::AffineFlow;
use std::f64::consts::TAU;

/// Parallel layers: `u = (speed) sin(2 pi (y - phase) / wavelength)`, `v = 0`. Paths are straight lines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SinusoidalShear {
    /// Greatest speed, px/frame.
    pub speed: f64,
    /// Distance after which the layers repeat, px.
    pub wavelength: f64,
    /// A row at rest, px.
    pub phase: f64,
}

impl Motion for SinusoidalShear {
    fn velocity(&self, _x: f64, y: f64, _t: f64) -> AffineFlow<f64> {
        let wave_number = TAU / self.wavelength;
        let (sine, cosine) = (wave_number * (y - self.phase)).sin_cos();
        AffineFlow { u: self.speed * sine, u_y: self.speed * wave_number * cosine, ..AffineFlow::default() }
    }

    fn path_map(&self, from: f64, to: f64) -> PointMap<'_> {
        Box::new(move |x, y| (x + (to - from) * self.velocity(x, y, from).u, y))
    }
}
