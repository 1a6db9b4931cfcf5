//! Trackers: one moving target each, behind one trait.
//!
//! A tracker is begun with a frame and what is known of the target in it, and is then given one frame after the other.

mod tracker;

pub use tracker::Tracker;
