//! Any texture carried by any motion; band-limited noise by a steady affine one.

use super::motion::{AffineField, Motion};
use super::texture::{Noise, Texture};
use super::{Scene, scene::render};
use crate::error::Result;
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

/// Gaussian-filtered noise moving by `u(p) = (u, v) + M (p - c)`, the same at every time: the scene on
/// which affine estimators are measured.
pub type AffineTexture = Carried<Noise, AffineField>;

impl AffineTexture {
    /// Noise of standard deviation 40 grey levels about 128, filtered by a Gaussian of 2 px, moving by
    /// `motion = (u, v, u_x, v_x, u_y, v_y)` at the centre of the frame, `((width - 1) / 2, (height - 1) /
    /// 2)`.
    ///
    /// # Errors
    /// None with these settings; passes on what [`Noise::new`] reports.
    pub fn moving(size: (usize, usize), motion: [f64; 6], seed: u64) -> Result<Self> {
        Ok(Self::with_noise(size, motion, Noise::new(2.0, 40.0, 128.0, seed)?))
    }

    /// The same motion of a noise of one's own.
    pub fn with_noise(size: (usize, usize), motion: [f64; 6], noise: Noise) -> Self {
        let centre = ((size.0 as f64 - 1.0) / 2.0, (size.1 as f64 - 1.0) / 2.0);
        Carried::new(size, noise, AffineField::new(motion, centre))
    }

    /// The settings that the estimators' accuracy is quoted for: `M = [[0.01, -0.02], [0.02, 0.01]]`, `(u, v)
    /// = (0.3, -0.2)` at the centre, noise filtered by 2 px with a standard deviation of 40 grey levels.
    pub fn reference(width: usize, height: usize, seed: u64) -> Result<Self> {
        Self::moving((width, height), [0.3, -0.2, 0.01, 0.02, -0.02, 0.01], seed)
    }
}
