//! Small numerical parts that know nothing of images.

pub mod dense;
pub mod random;
mod real;
pub mod special;
mod statistics;
mod vectors;
mod ziggurat;

pub use real::Real;
pub use statistics::{
    MAD_TO_STD, RARE_STDS, TRUNCATED_INFORMATION, binomial_tail, by_chance, central_median, chi2_deviation,
    geman_mcclure, median, nearest_quantile, quantile, robust_std, truncated_std,
};
pub use vectors::{carried, root, tangents};
