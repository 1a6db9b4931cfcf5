//! What people want the flow and its Jacobian for: divergence, curl, shear, rotation, time to contact; each
//! with the standard deviation that the covariance of the motion gives it to first order, `sd^2 = grad^T
//! Cov(m) grad`.
//!
//! `quantity` has the formulas, `value` their standard deviations; `region` (means) and `region_motion` (one
//! affine fit) allow for `sharing`, the pixels that estimates have in common.

mod quantity;
mod region;
mod region_motion;
mod sharing;
mod value;

pub use quantity::Quantity;
pub use region::{Aggregate, Mean, parameter_mean, plane, planes, region_mean};
pub use region_motion::{RegionMotion, fit_region};
pub use sharing::sharing;
pub use value::value_and_std;
