//! Estimates the motion of points that all have the same one, in this order.
//!
//! `starts` searches the half sphere of directions and `refine` descends from there; `finite_rotation`
//! repeats that with the rotation taken out of displacements. `likelihood` chooses among the minima.
//! `regression` and `smoothing` predict inverse depths from those nearby, and `efficient` solves the
//! estimating equation with these in its weights. `covariance` and `profile_likelihood` compute how well the
//! direction is known.

pub(crate) mod covariance;
pub(crate) mod efficient;
pub(crate) mod finite_rotation;
pub(crate) mod likelihood;
pub(crate) mod profile_likelihood;
pub(crate) mod refine;
pub(crate) mod regression;
pub(crate) mod smoothing;
pub(crate) mod starts;
