//! What people want the flow and its Jacobian for: divergence, curl, shear, rotation, time to contact; each
//! with the standard deviation that the covariance of the motion gives it to first order, `sd^2 = grad^T
//! Cov(m) grad`.
//!
//! `quantity` has the names and units, `rate` the rates that displacements stand for, `value` the formulas
//! and their standard deviations. A region gives one number by its mean motion (`mean`) or by the one
//! affine motion that most of it follows (`dominant` finds it, `region_motion` fits it, `common_residual`
//! judges the fit, `measured` names what it gives); both allow for `sharing`, the pixels that estimates have
//! in common.

mod common_residual;
mod dominant;
mod mean;
mod measured;
mod quantity;
mod rate;
mod region;
mod region_motion;
mod sharing;
mod value;

pub use mean::{Aggregate, Mean, parameter_mean, region_mean};
pub use measured::Measured;
pub use quantity::Quantity;
pub use region::{plane, planes};
pub use region_motion::{RegionMotion, RegionStatus, fit_region};
pub use sharing::sharing;
pub use value::{Motion, unbiased_value_and_std, value_and_std};
