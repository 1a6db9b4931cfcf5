//! Small numerical parts that know nothing of images.

pub(crate) mod dense;
pub mod random;
mod real;
pub mod special;

pub use real::Real;
