//! How far an estimate can be trusted, and the report.
//!
//! `degenerate` and `plane_flow` recognise rotations and planes; `cheirality`, `confidence_region` and
//! `smaller_rotation` look for other motions that explain the flow as well, from which `status` follows.
//! `nonlinearity`, `correlated_noise`, `systematic_errors` and `rotation_prior` correct the covariance; `report`
//! assembles the result, to which `inliers` adds what the choice of points leaves in doubt.

pub(crate) mod cheirality;
pub(crate) mod confidence_region;
pub(crate) mod correlated_noise;
pub(crate) mod degenerate;
pub(crate) mod inliers;
pub(crate) mod nonlinearity;
pub(crate) mod plane_flow;
pub(crate) mod report;
pub(crate) mod rotation_prior;
pub(crate) mod smaller_rotation;
pub(crate) mod status;
pub(crate) mod systematic_errors;
