//! Band-limited noise under a steady affine motion: the scene on which affine estimators are measured.

use super::{carried::Carried, motion::AffineField, texture::Noise};
use crate::error::Result;

/// Gaussian-filtered noise moving by `u(p) = (u, v) + M (p - c)`, the same at every time.
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
