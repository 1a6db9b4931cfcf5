//! What is given and what is estimated, in the order of the data.
//!
//! `options` (flow, noise, method) and `camera` say what is given; `derotation` takes a rotation out of finite
//! displacements; `covariance_floor` limits given covariances; `whitening` turns points into rows of `f = nu G u
//! + R w` with unit noise, which `observations` holds as planes. `motion` is what is estimated, `result` what is
//! returned.

pub(crate) mod camera;
pub(crate) mod covariance_floor;
pub(crate) mod derotation;
pub(crate) mod motion;
pub(crate) mod observations;
pub(crate) mod options;
pub(crate) mod result;
pub(crate) mod whitening;
