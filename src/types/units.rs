//! The units of a field: one rule for results, pictures and files.

use crate::error::{Error, Result};
use std::ops::RangeInclusive;

/// What a length and a time of a field are measured in.
///
/// Lengths are in px, or in the unit of the pixel pitch where one is given; times are in frames, or in
/// seconds where the frame period is known. Flow, Jacobian, covariance and every derived quantity follow this
/// one rule: with a period of .01 s and a pitch of .02 mm flow is in mm/s, its Jacobian in 1/s.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Units {
    /// Physical size `(dx, dy)` of a pixel.
    pub pixel_pitch: (f64, f64),
    /// Name of the pitch's unit, "mm" for example. Without effect on numbers.
    pub length: String,
    /// Seconds between frames; `None`: times are in frames.
    pub frame_period: Option<f64>,
}

impl Default for Units {
    /// px and frames.
    fn default() -> Self {
        Self::new((1.0, 1.0), None, None)
    }
}

/// Pitches and periods whose products with flow in float32 neither overflow nor vanish.
const USABLE: RangeInclusive<f64> = 1e-20..=1e20;

impl Units {
    /// A pitch, the name of its unit, and seconds between frames. Without a name a pitch of 1 is in px, any
    /// other in "length".
    pub fn new(pixel_pitch: (f64, f64), length: Option<&str>, frame_period: Option<f64>) -> Self {
        let default = if pixel_pitch == (1.0, 1.0) { "px" } else { "length" };
        Self { pixel_pitch, length: length.unwrap_or(default).into(), frame_period }
    }

    /// # Errors
    /// [`Error::Argument`] naming `pixel_pitch` or `frame_period` unless they are positive and finite, and
    /// `length_unit` if it is blank.
    pub fn check(&self) -> Result<()> {
        let positive = |value| USABLE.contains(&value);
        let (dx, dy) = self.pixel_pitch;
        if !(positive(dx) && positive(dy)) {
            let expected = "two positive, finite lengths (1e-20 to 1e20)";
            return Err(Error::argument("pixel_pitch", expected, format!("({dx}, {dy})")));
        }
        if self.length.trim().is_empty() {
            return Err(Error::argument("length_unit", "the name of a unit, such as mm", format!("{:?}", self.length)));
        }
        match self.frame_period {
            Some(period) if !positive(period) => {
                Err(Error::argument("frame_period", "a positive number of seconds (1e-20 to 1e20)", period))
            }
            _ => Ok(()),
        }
    }

    /// Whether lengths are px and times are frames.
    pub fn are_pixels_and_frames(&self) -> bool {
        self.pixel_pitch == (1.0, 1.0) && self.frame_period.is_none()
    }

    /// Duration of a frame in the unit of time.
    pub fn period(&self) -> f64 {
        self.frame_period.unwrap_or(1.0)
    }

    /// Name of the unit of time.
    pub fn time(&self) -> &'static str {
        if self.frame_period.is_some() { "s" } else { "frame" }
    }

    /// Factor from px and frames to these units for the parameter called `name` (`u`, `v_x`, `u_t`, ...).
    pub fn scale(&self, name: &str) -> f64 {
        let (dx, dy) = self.pixel_pitch;
        let length = if name.starts_with('v') { dy } else { dx };
        match name.split_once('_').map(|(_, per)| per) {
            Some("x") => length / dx / self.period(),
            Some("y") => length / dy / self.period(),
            Some("t") => length / (self.period() * self.period()),
            _ => length / self.period(),
        }
    }

    /// Unit of the parameter called `name`.
    pub fn of_parameter(&self, name: &str) -> String {
        let (length, time) = (&self.length, self.time());
        match name.split_once('_').map(|(_, per)| per) {
            Some("x" | "y") => format!("1/{time}"),
            Some("t") => format!("{length}/{time}^2"),
            _ => format!("{length}/{time}"),
        }
    }
}
