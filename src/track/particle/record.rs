//! A step that stays whole when the tracker goes on.

use super::corners::Track;
use super::foreground::ForegroundMap;
use super::options::ParticleOptions;
use super::step::{CornerTrack, ParticleStep};
use super::tracker::ParticleTracker;
use super::view::in_levels;
use crate::error::{Error, Result};
use crate::segment::{Labels, felzenszwalb};
use crate::types::{AnyColourFrame, ColourFrame, Frame};
use std::sync::Arc;

/// Particles of a target, N x 6 (centre x, y, velocity u, v, width, height), and their weights.
pub type Particles = (Vec<[f64; 6]>, Vec<f64>);

/// A step, with its frame and particles unless they were dropped.
#[derive(Debug, Clone)]
pub struct StepRecord {
    pub(super) step: ParticleStep,
    pub(super) options: ParticleOptions,
    /// What samples of floats are multiplied by to be grey levels.
    pub(super) gain: f64,
    /// Factor of all lengths.
    pub(super) scale: f64,
    /// The frame, shared with the tracker.
    pub(super) frame: Option<Arc<AnyColourFrame>>,
    /// One for each target.
    pub(super) particles: Option<Vec<Particles>>,
}

impl ParticleTracker {
    /// The last step, with the last frame that showed something and all particles.
    pub fn record(&self) -> StepRecord {
        let particles = self.targets.iter().map(|t| (t.cloud.particles.clone(), t.cloud.weights.clone())).collect();
        StepRecord {
            step: self.step.clone(),
            options: self.options.clone(),
            gain: self.gain,
            scale: self.scale,
            frame: Some(Arc::clone(&self.last)),
            particles: Some(particles),
        }
    }
}

impl StepRecord {
    /// The step itself.
    pub fn step(&self) -> &ParticleStep {
        &self.step
    }

    /// Whether it keeps the frame, from which its pictures are made.
    pub fn keeps_frame(&self) -> bool {
        self.frame.is_some()
    }

    /// The same without the frame, unless `frame`, and without the particles, unless `particles`.
    #[must_use]
    pub fn keeping(mut self, frame: bool, particles: bool) -> Self {
        self.frame = self.frame.filter(|_| frame);
        self.particles = self.particles.filter(|_| particles);
        self
    }

    /// Particles and weights of a target; `None` where they were not kept.
    ///
    /// # Errors
    /// [`Error::Argument`] named `id` for a number that no target has.
    pub fn particles(&self, id: u64) -> Result<Option<&Particles>> {
        let ids = || self.step.targets.iter().map(|target| target.id);
        let at = ids().position(|known| known == id).ok_or_else(|| {
            let known: Vec<String> = ids().map(|id| id.to_string()).collect();
            Error::argument("id", format!("one of the numbers in use ({})", known.join(", ")), id)
        })?;
        Ok(self.particles.as_ref().and_then(|all| all.get(at)))
    }

    /// Segments of the frame.
    ///
    /// # Errors
    /// [`Error::Argument`] named `frame` where it was not kept.
    pub fn segments(&self) -> Result<Labels> {
        let options = self.options.segmentation(self.scale);
        self.options.threads.install(|| felzenszwalb(&self.colour()?, &options))
    }

    /// Foreground of the frame, 0 to 1: density of the corners that are not background, averaged over
    /// segments, over its maximum; all zero where there are no such corners.
    ///
    /// # Errors
    /// As [`StepRecord::segments`].
    pub fn foreground(&self) -> Result<Frame<f32>> {
        let track = |track: &CornerTrack| Track {
            id: track.id,
            position: track.position,
            flow: [0.0; 2],
            residual: Some(track.residual),
            last_residual: None,
            foreground: track.foreground,
            owner: track.owner,
        };
        let tracks: Vec<Track> = self.step.tracks.iter().map(track).collect();
        self.options
            .threads
            .install(|| Ok(ForegroundMap::of_frame(&tracks, &self.colour()?, self.scale, &self.options)?.picture()))
    }

    /// The frame in grey levels.
    fn colour(&self) -> Result<ColourFrame<f32>> {
        let missing = || Error::argument("frame", "a step that keeps its frame", "one that does not");
        Ok(in_levels(self.frame.as_ref().ok_or_else(missing)?, self.gain))
    }
}
