//! The tracker and its steps as bytes, from which they go on bit for bit.
//!
//! What follows from the last frame (colour bins, the pyramid) is made again.

use super::corners::{Corners, Track};
use super::options::ParticleOptions;
use super::record::{Particles, StepRecord};
use super::step::ParticleStep;
use super::target::Target;
use super::tracker::ParticleTracker;
use super::view::View;
use crate::error::Result;
use crate::track::persist::Kind;
use crate::types::AnyColourFrame;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

const TRACKER: Kind = Kind { mark: *b"JFPT", layout: 4, what: "particle tracker" };
const STEP: Kind = Kind { mark: *b"JFPS", layout: 3, what: "step of a particle tracker" };

#[derive(Serialize, Deserialize)]
struct SavedTracker {
    options: ParticleOptions,
    gain: f64,
    frame: u64,
    targets: Vec<Target>,
    tracks: Vec<Track>,
    next_track: u64,
    last: AnyColourFrame,
    step: ParticleStep,
    next_id: u64,
    missed: Vec<Option<[[f64; 3]; 2]>>,
}

/// What is kept of a step beyond the tracker.
#[derive(Serialize, Deserialize)]
struct SavedRecord {
    step: ParticleStep,
    options: ParticleOptions,
    gain: f64,
    scale: f64,
    frame: Option<AnyColourFrame>,
    particles: Option<Vec<Particles>>,
}

impl Kind {
    /// A step whose lists fit together.
    fn checked(&self, step: ParticleStep) -> Result<ParticleStep> {
        if step.near.len() == step.targets.len().pow(2) {
            Ok(step)
        } else {
            Err(self.damaged("lists of different lengths"))
        }
    }
}

impl ParticleTracker {
    /// Everything, as bytes: what they give back goes on as this one would, bit for bit.
    pub fn to_bytes(&self) -> Vec<u8> {
        TRACKER.sealed(&SavedTracker {
            options: self.options.clone(),
            gain: self.gain,
            frame: self.frame as u64,
            targets: self.targets.clone(),
            tracks: self.corners.tracks.clone(),
            next_track: self.corners.next_id,
            last: (*self.last).clone(),
            step: self.step.clone(),
            next_id: self.next_id,
            missed: self.missed.clone(),
        })
    }

    /// A tracker from the bytes that [`ParticleTracker::to_bytes`] gave.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) named `state` for bytes of another kind or layout, and for
    /// damaged ones.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let saved: SavedTracker = TRACKER.opened(bytes)?;
        let (size, last, options) = (saved.last.size(), saved.last, saved.options);
        options.check()?;
        let view = options.threads.install(|| View::new(&last, saved.gain, options.uses("particle.values")));
        let pyramid = options.threads.install(|| Corners::pyramid(view.grey));
        let scale = options.length_scale(size.1);
        let mut corners = Corners::new(scale);
        (corners.tracks, corners.next_id) = (saved.tracks, saved.next_track);
        Ok(Self {
            options,
            size,
            gain: saved.gain,
            scale,
            frame: saved.frame as usize,
            targets: saved.targets,
            corners,
            pyramid,
            bins: view.bins,
            last: Arc::new(last),
            step: TRACKER.checked(saved.step)?,
            next_id: saved.next_id,
            missed: saved.missed,
        })
    }
}

impl StepRecord {
    /// The step and all that it keeps, as bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        STEP.sealed(&SavedRecord {
            step: self.step.clone(),
            options: self.options.clone(),
            gain: self.gain,
            scale: self.scale,
            frame: self.frame.as_deref().cloned(),
            particles: self.particles.clone(),
        })
    }

    /// A step from the bytes that [`StepRecord::to_bytes`] gave.
    ///
    /// # Errors
    /// As [`ParticleTracker::from_bytes`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let saved: SavedRecord = STEP.opened(bytes)?;
        Ok(Self {
            step: STEP.checked(saved.step)?,
            options: saved.options,
            gain: saved.gain,
            scale: saved.scale,
            frame: saved.frame.map(Arc::new),
            particles: saved.particles,
        })
    }
}
