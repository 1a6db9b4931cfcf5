//! Plain data: frames, masks, regions, flow fields. No algorithms.

mod colour;
mod field;
mod frame;
mod motion;
mod region;
mod status;
mod track;

pub use colour::{AnyColourFrame, ColourFrame};
pub use field::{FieldLayout, FlowField};
pub use frame::{AnyFrame, Frame, Mask, Sample};
pub use motion::{AffineFlow, MOTION_NAMES};
pub use region::{Rect, SamplingGrid};
pub use status::Status;
pub use track::{TargetBox, TrackState, TrackStatus};
