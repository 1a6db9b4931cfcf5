//! Grey images before any motion is looked for: borders, smoothing, quantising, colour to grey, sampling; and pictures of results.

mod blocks;
mod border;
mod luminance;
pub mod picture;
mod preprocess;
mod quantise;
mod sample;
mod smooth;
#[allow(dead_code)] // offered to the estimators that warp
mod spline;

pub use border::Border;
pub use luminance::luminance;
pub use preprocess::Preprocess;
pub use quantise::Quantiser;
pub use sample::Interpolation;
pub use smooth::GaussianSmoother;

#[allow(unused_imports)] // offered to the estimators that blur product planes
pub(crate) use smooth::{SeparableKernel, convolve_separable};
#[allow(unused_imports)] // as above
pub(crate) use spline::Spline;
