//! Small numerical parts that know nothing of images.

pub(crate) mod dense;
mod median;
pub mod random;
mod real;
pub mod special;
mod ziggurat;

pub(crate) use median::{MAD_TO_STD, median};
pub use real::Real;
