//! The everyday estimator: affine flow from coarse to fine.

#[allow(dead_code)]
mod couple;
#[allow(dead_code)]
mod data;
#[allow(dead_code)]
mod grid;
#[allow(dead_code)]
mod refine;
