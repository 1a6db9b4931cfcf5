//! Small numerical parts that know nothing of images.

pub mod random;
mod real;

pub use real::Real;
