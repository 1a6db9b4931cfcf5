//! `ParticleFilter` and `resample`.

mod class;
mod properties;
mod selection;
mod steps;

pub use class::{ParticleFilter, restore_particle};
pub use selection::resample;
