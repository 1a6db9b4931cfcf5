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

/// Pitches, periods and frame rates whose products with flow in float32 neither overflow nor vanish.
const USABLE: RangeInclusive<f64> = 1e-20..=1e20;

/// Refuses a value of `argument` outside [`USABLE`]; `expected` says what it is.
fn expect_usable(argument: &'static str, expected: &str, value: f64) -> Result<()> {
    if USABLE.contains(&value) {
        return Ok(());
    }
    let expected = format!("{expected} ({:e} to {:e})", USABLE.start(), USABLE.end());
    Err(Error::argument(argument, expected, value))
}

impl Units {
    /// A pitch, the name of its unit, and seconds between frames. Without a name a pitch of 1 is in px, any
    /// other in "length".
    pub fn new(pixel_pitch: (f64, f64), length: Option<&str>, frame_period: Option<f64>) -> Self {
        let default = if pixel_pitch == (1.0, 1.0) { "px" } else { "length" };
        Self { pixel_pitch, length: length.unwrap_or(default).into(), frame_period }
    }

    /// Seconds between frames at `fps` frames per second.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `fps` for a rate that is not positive, or beyond what float32 can hold.
    pub fn period_at(fps: f64) -> Result<f64> {
        expect_usable("fps", "a positive number of frames per second", fps)?;
        Ok(1.0 / fps)
    }

    /// # Errors
    /// [`Error::Argument`] naming `pixel_pitch` or `frame_period` unless they are positive and finite, and
    /// `length_unit` if it is blank.
    pub fn check(&self) -> Result<()> {
        let (dx, dy) = self.pixel_pitch;
        [dx, dy].into_iter().try_for_each(|side| expect_usable("pixel_pitch", "positive, finite lengths", side))?;
        if self.length.trim().is_empty() {
            return Err(Error::argument("length_unit", "the name of a unit, such as mm", format!("{:?}", self.length)));
        }
        self.frame_period.map_or(Ok(()), |period| expect_usable("frame_period", "a positive number of seconds", period))
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
