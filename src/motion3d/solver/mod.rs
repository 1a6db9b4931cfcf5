//! Estimates the motion of points that all have the same one, in this order.
//!
//! `starts` searches the half sphere of directions and `refine` descends from there; `finite_rotation`
//! repeats that with the rotation taken out of displacements. `likelihood` chooses among the minima.
//! `efficient` solves the estimating equation with smoothed depths in its weights. `covariance` and
//! `profile_likelihood` compute how well the direction is known.

pub(crate) mod covariance;
pub(crate) mod efficient;
pub(crate) mod finite_rotation;
pub(crate) mod likelihood;
pub(crate) mod profile_likelihood;
pub(crate) mod refine;
pub(crate) mod starts;

use super::model::observations::Observations;
use crate::math::random::CounterRng;
use crate::scattered::{SiteSmoother, Smoother};

/// Smooths the depths of points over those nearby.
pub(crate) fn depth_smoother(observations: &Observations, which: Smoother, rng: CounterRng) -> SiteSmoother {
    SiteSmoother::new(&observations.site, observations.spherical, which, rng)
}
