//! Rigid 3-D motion from noisy optical flow, with the bound that no estimator can beat.
//!
//! One translation `u` (a direction: `|u| = 1`), one rotation `w` and an inverse depth `nu_k` for every point
//! explain a flow field,
//!
//! ```text
//! f_k = nu_k G_k u + R_k w
//! plane: G = [[1, 0, -x], [0, 1, -y]],  R = [[-xy, 1 + x^2, -y], [-(1 + y^2), xy, x]]
//! ```
//!
//! Maximum likelihood minimises the part of the flow residual across the epipolar lines. Its covariance is
//! the Cramér-Rao bound plus a term of fourth order in the noise, because the depths that weigh its equations
//! are noisy themselves. [`Method::Efficient`] takes the weights from depths smoothed over neighbours; a
//! wrong weight costs variance and never causes bias, as the residual across an epipolar line is independent
//! of the depth along it.
//!
//! Source: T. Endoh, T. Toriu, N. Tagawa, "The Maximum Likelihood Estimator is Not 'Optimal' on 3-D Motion
//! Estimation from Noisy Optical Flow"; equation numbers are that paper's.
//!
//! `u` and `w` are the motion of the scene relative to the camera: `X_dot = u + w x X`; the camera's own
//! velocity is `-u`. Camera axes: x right, y down, z forward. Inverse depths are in units of `|u|` per frame.
//!
//! The entry point `estimate` leads the data through `model` (rows of unit noise), `robust` (outliers),
//! `solver` (minima and weights; both sum over points with `kernels`) and `diagnostics` (covariance, status,
//! report). `patches` does the same for affine flow, `field` takes points or windows of flow fields, `bound`
//! predicts covariances, `lateral` is the closed form without rotation.
//!
//! ```
//! use jacoflow::motion3d::{Flow, Method, Motion, MotionOptions, Noise, Placement, Status, estimate_motion};
//! # fn main() -> jacoflow::Result<()> {
//! let truth = Motion::new([0.6, 0.2, 0.75], [0.02, -0.03, 0.01]);
//! let place = |k: u32| [f64::from(k % 8) * 0.1 - 0.35, f64::from(k / 8) * 0.1 - 0.35];
//! let points: Vec<[f64; 2]> = (0..60).map(place).collect();
//! let inverse_depth = |k: usize| 0.6 + 0.4 * (k as f64).sin();
//! let flow: Vec<_> = (0..60).map(|k| truth.plane_flow(points[k], inverse_depth(k))).collect();
//! let flow = Flow::Plane { points: &points, flow: &flow, camera: None };
//! let options =
//!     MotionOptions { method: Method::Efficient, placement: Placement::Start, ..MotionOptions::default() };
//! let found = estimate_motion(&flow, &Noise::StandardDeviation(1e-4), &options)?;
//! assert_eq!(found.status, Status::Ok);
//! assert!(found.motion.angle_to(&truth) < 1e-3);
//! # Ok(())
//! # }
//! ```

mod bound;
mod diagnostics;
mod estimate;
mod field;
mod kernels;
mod lateral;
mod model;
mod patches;
mod robust;
mod solver;
#[cfg(test)]
mod tests;

pub use crate::scattered::Smoother;
pub use crate::types::Intrinsics;
pub use bound::{MotionBound, check_motion, motion_bound, patch_motion_bound};
pub use diagnostics::contact::{ContactMap, contact_map};
pub use estimate::estimate_motion;
pub use field::{
    FieldMotion, FieldOptions, FieldPatches, FieldPoints, estimate_field_motion, field_patches, field_points,
};
pub use lateral::{LateralBound, LateralEstimate, LateralWeights, estimate_lateral, lateral_bound};
pub use model::input::{Flow, Noise, Placement};
pub use model::motion::Motion;
pub use model::options::{Method, MotionOptions, RotationPrior, SystematicErrors};
pub use model::result::{
    Alternative, Likelihood, MotionEstimate, Status, SystematicEffect, UncertainMotion, focus_of_expansion,
};
pub use patches::{AffinePatches, estimate_patch_motion};
