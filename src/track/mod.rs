//! Trackers: follow targets from frame to frame.
//!
//! * [`GradientTracker`]: one target, behind the trait [`Tracker`]: begins with a frame and the target's box
//!   in it, then takes frame by frame.
//! * [`ParticleTracker`]: several targets that may look alike; takes all their boxes, since they need each
//!   other's predictions.
//! * [`StereoTracker`]: all moving objects before a pair of cameras; takes pairs of views, no boxes.
//!
//! `tracker` has the trait; `grey_levels` brings frames to the scale of the thresholds; `persist` keeps
//! trackers as bytes.

pub mod gradient;
mod grey_levels;
pub mod particle;
mod persist;
pub mod stereo;
mod tracker;

pub use gradient::GradientTracker;
pub use grey_levels::GreyLevels;
pub use particle::ParticleTracker;
pub use stereo::StereoTracker;
pub use tracker::Tracker;

/// Names of the methods; a new tracker is one folder and one name here.
pub const METHODS: &[&str] = &["gradient", "stereo", "particle"];
