//! Kalman filters and the particle filter, each against definitions, records of filterpy and its own promises.

mod filter;
mod particle;
mod particle_resampling;
mod particle_weights;
