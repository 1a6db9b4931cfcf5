//! What a scene can be given.

use super::{list::SCENES, list::TargetSceneKind};
use crate::error::{Error, Result};

/// Largest number of frames: the paths of camera and targets are kept in memory.
const MAX_FRAMES: usize = 1_000_000;

/// Smallest and largest scale: a limb is as wide as a pixel, a frame has 6000 columns.
const SCALES: (f64, f64) = (0.1, 8.0);

/// Options of a scene of targets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetSceneOptions {
    /// Seed of world, texture, gait, shake and noise: another recording of the same scene.
    pub random_state: u64,
    /// What all lengths are multiplied by; at 1 a frame has 720 x 480 px.
    pub scale: f64,
    /// Standard deviation of the white noise of each channel, grey levels.
    pub noise: f64,
    /// Number of frames; `None`: the scene's own. Zoom and sizes reach their last value in the last one.
    pub frames: Option<usize>,
    /// Colour cast in the last frame, 0 to 1: red is multiplied by `1 - r`, blue by `1 + r / 2`.
    pub colour_cast: f64,
}

impl Default for TargetSceneOptions {
    fn default() -> Self {
        Self { random_state: 0, scale: 0.5, noise: 2.5, frames: None, colour_cast: 0.0 }
    }
}

impl TargetSceneOptions {
    /// The scene of a name, if the options suit a scene.
    ///
    /// # Errors
    /// [`Error::Argument`] naming what does not.
    pub(super) fn check(&self, name: &str) -> Result<&'static TargetSceneKind> {
        let Some(kind) = SCENES.iter().find(|kind| kind.name == name) else {
            let names: Vec<_> = SCENES.iter().map(|kind| kind.name).collect();
            return Err(Error::argument("name", format!("one of {}", names.join(", ")), format!("{name:?}")));
        };
        if !(SCALES.0..=SCALES.1).contains(&self.scale) {
            return Err(Error::argument("scale", format!("{} to {}", SCALES.0, SCALES.1), self.scale));
        }
        if !(self.noise.is_finite() && self.noise >= 0.0) {
            return Err(Error::argument("noise", "a finite number of grey levels, 0 or more", self.noise));
        }
        if let Some(frames) = self.frames.filter(|frames| !(1..=MAX_FRAMES).contains(frames)) {
            return Err(Error::argument("frames", format!("a positive integer up to {MAX_FRAMES}"), frames));
        }
        if !(0.0..=1.0).contains(&self.colour_cast) {
            return Err(Error::argument("colour_cast", "0 to 1", self.colour_cast));
        }
        Ok(kind)
    }
}
