//! How far an estimate can be trusted, and the report.
//!
//! `rotation_only` and `planar_twin` recognise degenerate scenes. `solution` corrects the covariance, with
//! `rotation_prior` and `correlated_noise`. `confidence_region` looks for other motions that explain the flow
//! as well, from which `status` follows. `report` assembles the result, with times to contact from
//! `contact`.

pub(crate) mod confidence_region;
pub(crate) mod contact;
pub(crate) mod correlated_noise;
pub(crate) mod planar_twin;
pub(crate) mod report;
pub(crate) mod rotation_only;
pub(crate) mod rotation_prior;
pub(crate) mod solution;
pub(crate) mod status;
