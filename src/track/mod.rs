//! Trackers: follow targets from frame to frame.
//!
//! * [`GradientTracker`]: one target, behind the trait [`Tracker`]: begins with a frame and the target's box
//!   in it, then takes frame by frame.
//! * [`ParticleTracker`]: several targets that may look alike; takes all their boxes, since they need each
//!   other's predictions.
//! * [`StereoTracker`]: all moving objects before a pair of cameras; takes pairs of views, no boxes.
//!
//! `grey_levels` brings frames to the scale of the thresholds; `persist` keeps trackers as bytes.

pub mod gradient;
mod grey_levels;
pub mod particle;
mod persist;
pub mod stereo;

pub use gradient::GradientTracker;
pub use grey_levels::GreyLevels;
pub use particle::ParticleTracker;
pub use stereo::StereoTracker;

use crate::error::Result;
use crate::types::{Frame, TrackState};

/// Names of the methods; a new tracker is one folder and one name here.
pub const METHODS: &[&str] = &["gradient", "stereo", "particle"];

/// A tracker of one target. It is deterministic, keeps bounded memory and shares nothing with others: several
/// targets are several trackers.
pub trait Tracker: Send {
    /// The target in the next frame. Frames that cannot be used (any sample that is not finite) count as
    /// frames in which the target was not seen.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) named `frame` for another size than the first frame's.
    fn update(&mut self, frame: &Frame<f64>) -> Result<TrackState>;

    /// The target at the last frame.
    fn state(&self) -> &TrackState;
}
