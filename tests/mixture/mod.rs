//! Mixtures of Gaussians by variational Bayes and Dirichlet-process mixtures.

mod cases;
mod dirichlet;
mod variational;

// The cases name them by their place in the crate, whose unit tests share them.
use jacoflow::{math, mixture};
