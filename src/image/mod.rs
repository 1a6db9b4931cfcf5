//! Images before motion: borders, smoothing, quantising, grey, sampling, corners; and pictures.

mod blocks;
mod border;
mod corners;
mod cubic;
mod fill;
mod finite;
mod gradient;
mod luminance;
pub mod picture;
mod preprocess;
mod pyramid;
mod quantise;
mod sample;
mod smooth;
mod spline;
mod structure_tensor;

pub use border::Border;
pub use corners::{CORNER_WINDOW, CornerOptions, corner_score, corner_score_into, select_corners};
pub use cubic::{cubic_at, cubic_at_all};
pub use fill::{fill_holes, usable_pixels};
pub use gradient::gaussian_gradient;
pub use luminance::luminance;
pub use preprocess::Preprocess;
pub use pyramid::{halve, halve_into, halve_mask, halved_noise, halved_size};
pub use quantise::Quantiser;
pub use sample::{Interpolation, lagrange_at};
pub use smooth::GaussianSmoother;
pub use spline::Spline;
pub use structure_tensor::StructureTensor;

pub(crate) use finite::all_finite;
pub(crate) use quantise::are_rounded;
