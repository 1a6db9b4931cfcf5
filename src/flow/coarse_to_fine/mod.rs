//! The everyday estimator: affine flow from coarse to fine.

mod couple;
mod covariance;
mod data;
mod grid;
mod levels;
mod options;
mod output;
mod reference;
mod refine;
mod resample;
mod rows;
mod run;

pub use options::{CoarseToFineOptions, LEAST_SIDE, Preset};
pub(super) use run::CoarseToFine;

/// How far errors of neighbouring estimates go together, px: about the middle of the windows that are chosen.
pub(super) const CORRELATION_LENGTH: f64 = 4.0;
