//! How far an estimate can be trusted, and the report.
//!
//! `rotation` and `planar_twin` recognise degenerate scenes. `solution` corrects the covariance, with what is
//! known of the rotation and `correlated_noise`. `status` looks for other motions that explain the flow as
//! well. `report` assembles the result, with times to contact from `contact`.

pub(crate) mod contact;
pub(crate) mod correlated_noise;
pub(crate) mod planar_twin;
pub(crate) mod report;
pub(crate) mod rotation;
pub(crate) mod solution;
pub(crate) mod status;
