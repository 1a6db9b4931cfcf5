//! Images before motion: borders, smoothing, quantising, grey, sampling, corners; and pictures.

mod blocks;
mod corners;
mod cubic;
mod fill;
mod finite;
mod gradient;
pub mod picture;
mod preprocess;
mod pyramid;
mod quantise;
mod sample;
mod smooth;
mod spline;

pub use corners::{CORNER_WINDOW, CornerOptions, corner_score, corner_score_into, select_corners};
pub use cubic::{cubic_at, cubic_at_all};
pub use fill::{fill_holes, usable_pixels};
pub use gradient::{StructureTensor, gaussian_gradient};
pub use preprocess::{Preprocess, luminance};
pub use pyramid::{halve, halve_into, halve_mask, halved_noise, halved_size};
pub use quantise::Quantiser;
pub use sample::{Border, Interpolation, lagrange_at};
pub use smooth::GaussianSmoother;
pub use spline::Spline;

pub(crate) use finite::all_finite;
pub(crate) use quantise::are_rounded;
