//! What a camera does to a scene: noise, grey levels, saturation.

use crate::error::{Error, Result};
use crate::math::random::CounterRng;
use crate::types::Frame;

/// How brightness becomes whole grey levels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Rounding {
    /// Left as it is.
    #[default]
    None,
    /// The next integer below, as the patent's quantiser does.
    Floor,
    /// The nearest integer, as a camera's converter does.
    Nearest,
}

/// Additive white noise, then rounding, then clipping. The default changes nothing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sensor {
    /// Standard deviation of the white normal noise, grey levels.
    pub noise: f64,
    /// How brightness becomes whole grey levels.
    pub rounding: Rounding,
    /// Whether values are clipped to 0 ..= 255.
    pub saturate: bool,
    /// Seed of the noise.
    pub random_state: u64,
}

impl Sensor {
    /// An 8-bit camera: noise, the nearest grey level, clipped to 0 ..= 255.
    pub fn eight_bit(noise: f64, seed: u64) -> Self {
        Self { noise, rounding: Rounding::Nearest, saturate: true, random_state: seed }
    }

    /// Refuses noise that is negative or not finite.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `noise`.
    pub fn check(&self) -> Result<()> {
        if self.noise.is_finite() && self.noise >= 0.0 {
            return Ok(());
        }
        Err(Error::argument("noise", "a finite number of grey levels, 0 or more", self.noise))
    }

    /// The frame as the camera delivers it. Noise depends on the seed, the frame's `index` and the pixel.
    pub fn apply(&self, frame: &Frame<f64>, index: u64) -> Frame<f64> {
        let rng = CounterRng::new(self.random_state).stream(index);
        let mut pixel = 0u64;
        frame.map(|&value| {
            let noise = if self.noise > 0.0 { self.noise * rng.normal(pixel) } else { 0.0 };
            pixel += 1;
            let level = match self.rounding {
                Rounding::None => value + noise,
                Rounding::Floor => (value + noise).floor(),
                Rounding::Nearest => (value + noise).round(),
            };
            if self.saturate { level.clamp(0.0, 255.0) } else { level }
        })
    }

    /// As [`Sensor::apply`], as 8-bit samples, cut off and clipped to 0 ..= 255.
    pub fn apply_u8(&self, frame: &Frame<f64>, index: u64) -> Frame<u8> {
        self.apply(frame, index).map(|&value| value as u8)
    }
}
