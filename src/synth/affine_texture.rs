//! Band-limited noise under a steady affine motion: the scene on which affine estimators are measured.

use super::carried::Carried;
use super::motion::AffineField;
use super::texture::Noise;
use crate::error::Result;

/// Gaussian-filtered noise moving by `u(p) = (u, v) + M (p - c)`; the truth at a fixed pixel is the same at
/// every time.
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
        Carried::new("affine", size, noise, AffineField::new(motion, centre))
    }

    /// The settings that the estimators' accuracy is quoted for: `M = [[0.01, -0.02], [0.02, 0.01]]`, `(u, v)
    /// = (0.3, -0.2)` at the centre, noise filtered by 2 px with a standard deviation of 40 grey levels.
    ///
    /// # Errors
    /// As [`AffineTexture::moving`].
    pub fn reference(width: usize, height: usize, seed: u64) -> Result<Self> {
        Self::moving((width, height), [0.3, -0.2, 0.01, 0.02, -0.02, 0.01], seed)
    }
}

#[cfg(test)]
mod tests {
    use super::super::carried::conformance;
    use super::*;
    use crate::parallel::Threads;
    use crate::synth::{Scene, truth};

    #[test]
    fn brightness_is_constant_along_the_true_motion() {
        conformance::check(&AffineTexture::reference(64, 48, 3).unwrap(), 1e-4);
    }

    #[test]
    fn truth_is_the_affine_field_and_steady() {
        let scene = AffineTexture::reference(65, 65, 3).unwrap();
        let field = truth(&scene, 5.0).unwrap();
        assert_eq!(field.affine(32 * 65 + 32).to_array(), [0.3, -0.2, 0.01, 0.02, -0.02, 0.01]);
        let corner = field.affine(0);
        assert!((corner.u - (0.3 - 0.32 + 0.64)).abs() < 1e-12 && (corner.v - (-0.2 - 0.64 - 0.32)).abs() < 1e-12);
        assert_eq!(scene.motion(3.0, 4.0, 0.0), scene.motion(3.0, 4.0, 9.0));
    }

    #[test]
    fn a_seed_gives_the_same_bits_on_any_number_of_threads() {
        let scene = AffineTexture::reference(70, 50, 8).unwrap();
        let one = Threads::new(Some(1)).unwrap().install(|| scene.frame(3.0));
        let three = Threads::new(Some(3)).unwrap().install(|| AffineTexture::reference(70, 50, 8).unwrap().frame(3.0));
        assert_eq!(one, three);
        assert_ne!(one, AffineTexture::reference(70, 50, 9).unwrap().frame(3.0));
    }
}
