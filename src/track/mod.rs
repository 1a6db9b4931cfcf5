//! Trackers: of one moving target each, behind one trait; of several targets that may look alike; and of everything that moves before a pair of cameras.
//!
//! A tracker of one target is begun with a frame and what is known of the target in it, and is then given one frame after the other; [`ParticleTracker`] is given the boxes of all its targets, which need each other's predictions; [`StereoTracker`] is told nothing
//! beforehand and is given pairs of views.

pub mod gradient;
mod grey_levels;
pub mod particle;
pub mod stereo;
mod tracker;

pub use gradient::GradientTracker;
pub use grey_levels::GreyLevels;
pub use particle::ParticleTracker;
pub use stereo::StereoTracker;
pub use tracker::Tracker;

/// Names of the methods; a new tracker is one folder and one name here.
pub const METHODS: &[&str] = &["gradient", "stereo", "particle"];
