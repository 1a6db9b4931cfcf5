//! Trackers: one moving target each, behind one trait.
//!
//! A tracker is begun with a frame and what is known of the target in it, and is then given one frame after the other.

pub mod gradient;
mod grey_levels;
mod tracker;

pub use gradient::GradientTracker;
pub use grey_levels::GreyLevels;
pub use tracker::Tracker;

/// Names of the methods; a new tracker is one folder and one name here.
pub const METHODS: &[&str] = &["gradient"];
