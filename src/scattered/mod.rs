//! Values at scattered places: a k-d tree, local regression on the nearest, and smoothing by what these
//! predict.

mod regression;
mod smoothing;
mod tree;

pub use smoothing::Smoother;
pub(crate) use smoothing::{SiteSmoother, Smoothed};
pub(crate) use tree::{Neighbours, Tree};
