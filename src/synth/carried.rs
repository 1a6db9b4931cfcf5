//! Any texture carried by any motion.

use super::{Scene, motion::Motion, scene::render, texture::Texture};
use crate::types::{AffineFlow, Frame};

/// `I(p, t) = texture(phi(p))`, where `phi` follows the particle path through `p` at time `t` back to time 0.
///
/// Brightness is constant along every path, exactly: `I_t + u I_x + v I_y = 0`.
#[derive(Debug, Clone)]
pub struct Carried<X, M> {
    /// `(width, height)` of a frame, px.
    pub size: (usize, usize),
    /// Scene coordinates of pixel (0, 0), px.
    pub origin: (f64, f64),
    /// What is carried: brightness at time 0.
    pub texture: X,
    /// What carries it.
    pub motion: M,
}

impl<X: Texture, M: Motion> Carried<X, M> {
    /// `texture` carried by `motion`, seen through a window whose pixel (0, 0) is the scene's (0, 0).
    pub fn new(size: (usize, usize), texture: X, motion: M) -> Self {
        Self { size, origin: (0.0, 0.0), texture, motion }
    }
}

impl<X: Texture, M: Motion> Scene for Carried<X, M> {
    fn size(&self) -> (usize, usize) {
        self.size
    }
    fn origin(&self) -> (f64, f64) {
        self.origin
    }
    fn brightness(&self, x: f64, y: f64, t: f64) -> f64 {
        let (x, y) = self.motion.path_map(t, 0.0)(x, y);
        self.texture.value(x, y)
    }
    fn motion(&self, x: f64, y: f64, t: f64) -> Option<AffineFlow<f64>> {
        self.motion.truth(x, y, t)
    }
    fn displacement(&self, x: f64, y: f64, t: f64, duration: f64) -> Option<(f64, f64)> {
        Some(self.motion.displacement(x, y, t, duration))
    }
    fn max_duration(&self) -> f64 {
        self.motion.max_duration()
    }
    fn frame(&self, t: f64) -> Frame<f64> {
        let back = self.motion.path_map(t, 0.0);
        let origin = self.origin;
        render(self.size, |column, row| {
            let (x, y) = back(origin.0 + column as f64, origin.1 + row as f64);
            self.texture.value(x, y)
        })
    }
}
