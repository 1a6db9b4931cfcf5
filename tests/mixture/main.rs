//! Mixtures of Gaussians by variational Bayes and Dirichlet-process mixtures.

mod dirichlet;
mod mixture;
