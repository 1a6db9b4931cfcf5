//! Brightness of matter at rest, defined and smooth at every real point of an unbounded plane.

mod noise;
mod speckle;

pub use noise::Noise;
pub use speckle::Speckle;
pub(crate) use speckle::{cell_index, poisson_of_mean_one, smooth_step};

/// The brightness that matter carries with it.
pub trait Texture: Send + Sync {
    /// Brightness at the material point `(x, y)` px, grey levels.
    fn value(&self, x: f64, y: f64) -> f64;
}

impl<T: Texture + ?Sized> Texture for Box<T> {
    fn value(&self, x: f64, y: f64) -> f64 {
        (**self).value(x, y)
    }
}
