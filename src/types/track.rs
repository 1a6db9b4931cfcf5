//! State of a tracked target, frame by frame.

use super::choices;
use std::borrow::Cow;

/// A rectangle with real sides, px: its upper left corner is `(x, y)`, pixel centres lie at integers, so that
/// its centre is `(x + width / 2, y + height / 2)`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TargetBox {
    /// Left side, px.
    pub x: f64,
    /// Upper side, px.
    pub y: f64,
    /// Width, px.
    pub width: f64,
    /// Height, px.
    pub height: f64,
}

impl TargetBox {
    /// The box of a size about a centre.
    pub fn about(centre: [f64; 2], width: f64, height: f64) -> Self {
        Self { x: centre[0] - width / 2.0, y: centre[1] - height / 2.0, width, height }
    }

    /// Its centre `(x, y)`, px.
    pub fn centre(&self) -> [f64; 2] {
        [self.x + self.width / 2.0, self.y + self.height / 2.0]
    }

    /// Area of the intersection over area of the union, 0 where they do not touch.
    pub fn overlap(&self, other: &Self) -> f64 {
        let side = |a: f64, la: f64, b: f64, lb: f64| ((a + la).min(b + lb) - a.max(b)).max(0.0);
        let common = side(self.x, self.width, other.x, other.width) * side(self.y, self.height, other.y, other.height);
        let union = self.width * self.height + other.width * other.height - common;
        if union > 0.0 { common / union } else { 0.0 }
    }
}

/// Status of the target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[repr(u8)]
pub enum TrackStatus {
    /// Seen and measured.
    #[default]
    Tracking = 0,
    /// Partly visible: occluded or touched by another object. The template is not updated.
    Occluded = 1,
    /// Not visible: predicted by the filter.
    Coasting = 2,
    /// Beyond the border of the picture.
    Out = 3,
    /// Not visible for so long that it counts as lost; the search continues.
    Lost = 4,
}

choices!(TrackStatus: Tracking "tracking", Occluded "occluded", Coasting "coasting", Out "out", Lost "lost");

impl TrackStatus {
    /// Whether this frame's picture of the target was measured.
    pub fn is_measured(self) -> bool {
        matches!(self, Self::Tracking | Self::Occluded)
    }
}

/// The target at one frame, in px and frames, x right, y down; what a method lacks is NaN or `None`.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TrackState {
    /// Which frame, counted from the one the tracker began with (0).
    pub frame: usize,
    /// Status of the target.
    pub status: TrackStatus,
    /// Reason for the status, in a few words; may be empty.
    pub reason: Cow<'static, str>,
    /// Whether this is the first measurement after the target was lost or out of the picture.
    pub reacquired: bool,
    /// Filtered position of the target's centre, px.
    pub position: [f64; 2],
    /// Filtered velocity in the picture, px/frame: that in the scene and that of the camera together.
    pub velocity: [f64; 2],
    /// Filtered acceleration, px/frame^2.
    pub acceleration: [f64; 2],
    /// Velocity relative to the scene, px/frame.
    pub scene_velocity: [f64; 2],
    /// Displacement of the static background since the frame before, px; zero for a static camera.
    pub camera_motion: [f64; 2],
    /// Covariance of (position, velocity, acceleration) along x and along y.
    pub covariance: [[[f64; 3]; 3]; 2],
    /// Measured displacement since the frame before, unfiltered, px; NaN without a measurement.
    pub displacement: [f64; 2],
    /// The target's box, upright.
    pub bounds: TargetBox,
    /// Size over that at the beginning.
    pub scale: f64,
    /// Angle turned since the beginning, rad, from x towards y (clockwise on the screen), not wrapped.
    pub rotation: f64,
    /// Whether the target's picture determines its rotation.
    pub rotation_observable: bool,
    /// Visible share of the target, 0 to 1.
    pub visibility: f64,
    /// Normalised innovation squared of the position, both axes together; NaN without a measurement.
    pub innovation: f64,
    /// Brightness of the target over that at the beginning.
    pub gain: f64,
}

impl TrackState {
    /// A target at rest, with nothing measured yet.
    pub fn at(position: [f64; 2], bounds: TargetBox) -> Self {
        Self {
            frame: 0,
            status: TrackStatus::Tracking,
            reason: "".into(),
            reacquired: false,
            position,
            velocity: [0.0; 2],
            acceleration: [0.0; 2],
            scene_velocity: [0.0; 2],
            camera_motion: [0.0; 2],
            covariance: [[[0.0; 3]; 3]; 2],
            displacement: [f64::NAN; 2],
            bounds,
            scale: 1.0,
            rotation: 0.0,
            rotation_observable: true,
            visibility: 1.0,
            innovation: f64::NAN,
            gain: 1.0,
        }
    }
}
