//! Several targets that may look alike, cross and hide each other, before a moving camera: a particle filter each, on colour frames.
//!
//! In the order in which a frame passes them: [`view`] (colour bins, brightness), [`corners`] (corner tracks), [`camera`] or [`foreground`] (what
//! is background), [`seeing`] (predictions, near and hidden targets; [`labels`], [`presence`]), then for each [`target`] its particles
//! ([`cloud`]), [`recovery`], colours ([`appearance`], [`colour_table`]), [`evidence`] of tracks and [`likelihood`]; last [`report`].
//! [`record`] keeps a step, [`persist`] makes bytes of it and of the tracker.

mod appearance;
mod bins;
mod camera;
mod cloud;
mod colour_table;
mod corners;
mod evidence;
mod foreground;
mod geometry;
mod labels;
mod likelihood;
mod options;
mod persist;
mod presence;
mod record;
mod recovery;
mod report;
mod seeing;
mod step;
mod target;
mod tracker;
mod view;

pub use options::{ForegroundModel, Likelihoods, ParticleMode, ParticleOptions};
pub use record::{Particles, StepRecord};
pub use step::{CornerTrack, ParticleStep, ParticleTarget};
pub use tracker::ParticleTracker;
