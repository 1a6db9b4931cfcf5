//! Images before motion: borders, smoothing, quantising, grey, sampling, corners; and pictures.

mod blocks;
mod border;
mod corners;
mod cubic;
#[allow(dead_code)] // offered to the estimators that warp
mod fill;
mod finite;
mod gradient;
mod luminance;
pub mod picture;
mod preprocess;
#[allow(dead_code)] // as above
mod pyramid;
mod quantise;
mod sample;
mod smooth;
#[allow(dead_code)] // as above
mod spline;
mod structure_tensor;

pub use border::Border;
pub use corners::{CORNER_WINDOW, CornerOptions, corner_score, corner_score_into, select_corners};
pub use luminance::luminance;
pub use preprocess::Preprocess;
pub use quantise::Quantiser;
pub(crate) use quantise::are_rounded;
pub use sample::Interpolation;
pub use smooth::GaussianSmoother;

pub(crate) use cubic::{cubic_at, cubic_at_all};
pub(crate) use fill::fill_holes;
pub(crate) use finite::all_finite;
pub(crate) use gradient::gaussian_gradient;
pub(crate) use pyramid::{halve_into, halve_mask, halved_noise, halved_size};
#[allow(unused_imports)] // offered to the estimators that blur product planes
pub(crate) use smooth::{SeparableKernel, convolve_separable};
pub(crate) use spline::Spline;
pub(crate) use structure_tensor::StructureTensor;
