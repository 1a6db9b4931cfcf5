//! Flow and its Jacobian from two or three frames.
//!
//! Frames go through [`Estimator`]: a [`Method`] with its options and [`EstimatorOptions`]; the result is a
//! [`FlowField`](crate::types::FlowField). [`METHODS`] is the table of the methods, their options and what
//! each can do.
//!
//! * [`coarse_to_fine`]: affine flow with a pyramid, warping and robust regularisation; the default for
//!   everyday frames.
//! * [`windowed`]: the equations of [`model`] over a window in which the motion is affine.
//! * [`instantaneous`]: per pixel, WO2010/098160 (34), from a 3x3x3 block of brightness; for locally
//!   quadratic images.
//! * [`baseline`]: Lucas-Kanade and Horn-Schunck, for comparison.
//! * [`model`]: the motion models; one file and one line each.
//! * [`points`]: flow at single points of two frames, by gradient steps on a pyramid.
//! * [`observability`]: which condition of theorem 1 holds at each pixel.
//! * [`derived`]: divergence, curl, shear, rotation, time to contact, with their standard deviations.
//! * [`advect`]: points moved by a field.
//!
//! `estimator` is the entry point, `intake` prepares frames; `methods` and `options` are the tables. What
//! methods share: `site` (bands of sites), `moment_filter` (sums over windows), `symmetric` (6x6 matrices in
//! lanes), `least_squares`.

mod advect;
pub mod baseline;
pub mod coarse_to_fine;
pub mod derived;
mod estimator;
pub mod instantaneous;
mod intake;
pub mod least_squares;
mod methods;
pub mod model;
mod moment_filter;
mod observability;
mod options;
pub mod points;
mod site;
pub(crate) mod symmetric;
pub mod windowed;

pub use advect::{Advected, PointCovariance, advect};
pub use estimator::Estimator;
pub use methods::{METHODS, Method, MethodInfo, MethodSettings, PAIR};
pub use observability::{Condition, Observability, ObservabilityMap, classify, observability};
pub use options::{EstimatorOptions, InitialFlow, RankPolicy};
