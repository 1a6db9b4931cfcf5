//! The tracker as bytes, from which it goes on bit for bit.

use super::StereoTracker;
use crate::error::Result;
use crate::track::persist::Kind;

const TRACKER: Kind = Kind { mark: *b"JFST", layout: 2, what: "stereo tracker" };

impl StereoTracker {
    /// Everything, as bytes: what they give back goes on as this one would, bit for bit.
    pub fn to_bytes(&self) -> Vec<u8> {
        TRACKER.sealed(self)
    }

    /// A tracker from the bytes that [`StereoTracker::to_bytes`] gave.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) named `state` for bytes of another kind or layout, and for
    /// damaged ones.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        TRACKER.opened(bytes)
    }
}
