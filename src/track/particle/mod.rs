//! Several targets that may look alike, cross and hide each other before a moving camera: a particle filter
//! each.
//!
//! A frame passes the files in this order:
//!
//! * [`view`]: colour bins ([`bins`]) and brightness;
//! * [`corners`]: corner tracks;
//! * [`camera`] or, in paper mode, [`foreground`]: motion of the background;
//! * [`prediction`]: predictions, near and hidden targets ([`labels`], [`presence`]);
//! * [`advance`], for each [`target`]: particles ([`cloud`]), [`recovery`], colours ([`appearance`],
//!   [`colour_table`]), [`evidence`] of tracks, [`likelihood`];
//! * [`report`]: the result ([`step`]).
//!
//! [`tracker`] calls them; [`options`], [`noise`] (numbers in which the modes differ) and [`geometry`]
//! (boxes) serve all. [`record`] keeps a step, [`persist`] serialises it and the tracker. Model and limits:
//! `docs/particle_tracker.md`.

mod advance;
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
mod noise;
mod options;
mod persist;
mod prediction;
mod presence;
mod record;
mod recovery;
mod report;
mod step;
mod target;
mod tracker;
mod view;

pub use options::{ForegroundModel, Likelihoods, ParticleMode, ParticleOptions};
pub use record::{Particles, StepRecord};
pub use step::{CornerTrack, ParticleStep, ParticleTarget};
pub use tracker::ParticleTracker;
