//! What all trackers have in common.

use crate::error::Result;
use crate::types::{Frame, TrackState};

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
