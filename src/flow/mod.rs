//! Flow and its Jacobian from two or three frames.
//!
//! [`Estimator`] is the one door: a [`Method`] with its options, [`EstimatorOptions`] options, frames in, a
//! [`FlowField`](crate::types::FlowField) out.
//!
//! * [`instantaneous`]: per pixel, WO2010/098160 (34): flow and Jacobian from nothing but a 3x3x3 block of
//!   brightness. Its domain is images that are locally quadratic and motion that makes them observable; on
//!   busy 8-bit texture use the windowed form.
//! * [`coarse_to_fine`]: affine flow with a pyramid, warping and robust coupling: the one for everyday
//!   frames.
//! * [`windowed`]: the same equations over a window in which the motion is affine.
//! * [`baseline`]: Lucas-Kanade and Horn-Schunck, for comparison.
//! * [`model`]: the motion models; one file and one line each.
//! * [`points`]: at single points of two frames, by gradient steps on a pyramid.
//! * [`observability`]: which condition of theorem 1 holds at each pixel.
//! * [`derived`]: divergence, curl, shear, rotation, time to contact, with their standard deviations.

mod advect;
pub mod baseline;
pub mod coarse_to_fine;
pub mod derived;
mod estimator;
pub mod instantaneous;
mod least_squares;
mod methods;
pub mod model;
mod observability;
mod options;
pub mod points;
mod site;
pub mod windowed;

pub use advect::{Advected, PointCovariance, advect};
pub use estimator::Estimator;
pub use methods::{METHODS, Method, MethodInfo, MethodSettings, PAIR};
pub use observability::{Condition, Observability, ObservabilityMap, classify, observability};
pub use options::{EstimatorOptions, RankPolicy};
