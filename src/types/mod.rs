//! Plain data: cameras, frames, masks, regions, flow fields. No algorithms.

mod camera;
mod choice;
mod field;
mod frame;
mod motion;
mod precision;
mod region;
mod status;
mod track;
mod units;

pub use camera::Intrinsics;
pub(crate) use choice::{choice_by_name, choices};
pub use field::{FieldLayout, FlowField, Interval};
pub use frame::{AnyColourFrame, AnyFrame, ColourFrame, Frame, LARGEST_EXACT_INTEGER, Mask, Sample, expect_dtype};
pub use motion::{AffineFlow, MOTION_NAMES};
pub use precision::{AnyField, Precision};
pub use region::{Rect, Region, SamplingGrid};
pub use status::Status;
pub use track::{TargetBox, TrackState, TrackStatus};
pub use units::Units;
