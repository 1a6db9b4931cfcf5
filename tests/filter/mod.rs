//! Kalman filters and the particle filter against definitions, records of filterpy and their own promises.

mod angles;
mod kalman;
mod particle;
mod particle_resampling;
mod particle_weights;
mod scalar;
mod soundness;
