//! How far an estimate can be trusted, and the report.
//!
//! `rotation` recognises that there is no translation, before a search and after it. `solution` corrects the
//! covariance, with what is known of the rotation and `correlated_noise`. `status` looks for other motions
//! that explain the flow as well, with the second one of a plane from `planar_twin`. `report` assembles the
//! result, with times to contact from `contact`, and doubts what few points decide.

pub(crate) mod contact;
pub(crate) mod correlated_noise;
pub(crate) mod planar_twin;
pub(crate) mod report;
pub(crate) mod rotation;
pub(crate) mod solution;
pub(crate) mod status;
