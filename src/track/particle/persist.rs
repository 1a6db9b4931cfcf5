//! The tracker and its steps as bytes, from which they go on bit for bit.
//!
//! A mark, the number of the layout, the content and a checksum. What follows from the last frame (colour
//! bins, the pyramid) is made again.

use super::corners::{Corners, Track};
use super::options::ParticleOptions;
use super::record::{Particles, StepRecord};
use super::report::REASONS;
use super::step::ParticleStep;
use super::target::Target;
use super::tracker::ParticleTracker;
use super::view::View;
use crate::error::{Error, Result};
use crate::types::{AnyColourFrame, ColourFrame, Frame};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The first bytes of a tracker and of a step.
const TRACKER_MARK: [u8; 4] = *b"JFPT";
const STEP_MARK: [u8; 4] = *b"JFPS";
/// Number of the layout: it goes up with every change of what is kept.
const LAYOUT: u16 = 2;
/// Bytes of mark and layout.
const HEAD: usize = 6;
/// Bytes of the checksum.
const TAIL: usize = 8;

#[derive(Serialize, Deserialize)]
struct SavedTracker {
    options: ParticleOptions,
    gain: f64,
    frame: u64,
    targets: Vec<Target>,
    tracks: Vec<Track>,
    next_track: u64,
    last: SavedFrame,
    step: SavedStep,
    next_id: u64,
    missed: Vec<Option<[[f64; 3]; 2]>>,
}

/// A step, and the reasons of its targets as their places in a list.
#[derive(Serialize, Deserialize)]
struct SavedStep {
    step: ParticleStep,
    reasons: Vec<u8>,
}

/// What is kept of a step beyond the tracker.
#[derive(Serialize, Deserialize)]
struct SavedRecord {
    step: SavedStep,
    options: ParticleOptions,
    gain: f64,
    scale: f64,
    frame: Option<SavedFrame>,
    particles: Option<Vec<Particles>>,
}

#[derive(Serialize, Deserialize)]
struct SavedFrame {
    width: usize,
    height: usize,
    samples: Samples,
}

#[derive(Serialize, Deserialize)]
enum Samples {
    U8(Vec<[u8; 3]>),
    U16(Vec<[u16; 3]>),
    F32(Vec<[f32; 3]>),
    F64(Vec<[f64; 3]>),
}

impl SavedFrame {
    fn of(frame: &AnyColourFrame) -> Self {
        let (width, height) = frame.size();
        let samples = match frame {
            AnyColourFrame::U8(frame) => Samples::U8(frame.data().to_vec()),
            AnyColourFrame::U16(frame) => Samples::U16(frame.data().to_vec()),
            AnyColourFrame::F32(frame) => Samples::F32(frame.data().to_vec()),
            AnyColourFrame::F64(frame) => Samples::F64(frame.data().to_vec()),
        };
        Self { width, height, samples }
    }

    fn restore(self) -> Result<AnyColourFrame> {
        fn frame<T>(size: (usize, usize), samples: Vec<[T; 3]>) -> Result<ColourFrame<T>> {
            Frame::new(size.0, size.1, samples).map_err(|_| damaged("a frame of another size than it says"))
        }
        let size = (self.width, self.height);
        Ok(match self.samples {
            Samples::U8(samples) => AnyColourFrame::U8(frame(size, samples)?),
            Samples::U16(samples) => AnyColourFrame::U16(frame(size, samples)?),
            Samples::F32(samples) => AnyColourFrame::F32(frame(size, samples)?),
            Samples::F64(samples) => AnyColourFrame::F64(frame(size, samples)?),
        })
    }
}

impl SavedStep {
    fn of(step: &ParticleStep) -> Self {
        let place = |reason: &str| REASONS.iter().position(|known| *known == reason).unwrap_or(0) as u8;
        let reasons = step.targets.iter().map(|target| place(target.state.reason)).collect();
        Self { step: step.clone(), reasons }
    }

    fn restore(self) -> Result<ParticleStep> {
        let Self { mut step, reasons } = self;
        if reasons.len() != step.targets.len() || step.near.len() != reasons.len().pow(2) {
            return Err(damaged("lists of different lengths"));
        }
        for (target, reason) in step.targets.iter_mut().zip(reasons) {
            target.state.reason = REASONS.get(usize::from(reason)).ok_or_else(|| damaged("an unknown reason"))?;
        }
        Ok(step)
    }
}

impl ParticleTracker {
    /// Everything, as bytes: what they give back goes on as this one would, bit for bit.
    pub fn to_bytes(&self) -> Vec<u8> {
        let saved = SavedTracker {
            options: self.options.clone(),
            gain: self.gain,
            frame: self.frame as u64,
            targets: self.targets.clone(),
            tracks: self.corners.tracks.clone(),
            next_track: self.corners.next_id,
            last: SavedFrame::of(&self.last),
            step: SavedStep::of(&self.step),
            next_id: self.next_id,
            missed: self.missed.clone(),
        };
        sealed(TRACKER_MARK, &saved)
    }

    /// A tracker from the bytes that [`ParticleTracker::to_bytes`] gave.
    ///
    /// # Errors
    /// [`Error::Argument`] named `state` for bytes of another kind or layout, or damaged ones.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let saved: SavedTracker = opened(TRACKER_MARK, bytes)?;
        let last = saved.last.restore()?;
        let (size, options) = (last.size(), saved.options);
        options.check()?;
        let view = options.threads.install(|| View::new(&last, saved.gain, options.uses("particle.values")));
        let pyramid = options.threads.install(|| Corners::pyramid(view.grey));
        let scale = options.length_scale(size.1);
        let mut corners = Corners::new(scale);
        (corners.tracks, corners.next_id) = (saved.tracks, saved.next_track);
        Ok(Self {
            options,
            size,
            dtype: last.dtype(),
            gain: saved.gain,
            scale,
            frame: saved.frame as usize,
            targets: saved.targets,
            corners,
            pyramid,
            bins: view.bins,
            last: Arc::new(last),
            step: saved.step.restore()?,
            next_id: saved.next_id,
            missed: saved.missed,
        })
    }
}

impl StepRecord {
    /// The step and all that it keeps, as bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let saved = SavedRecord {
            step: SavedStep::of(&self.step),
            options: self.options.clone(),
            gain: self.gain,
            scale: self.scale,
            frame: self.frame.as_deref().map(SavedFrame::of),
            particles: self.particles.clone(),
        };
        sealed(STEP_MARK, &saved)
    }

    /// A step from the bytes that [`StepRecord::to_bytes`] gave.
    ///
    /// # Errors
    /// As [`ParticleTracker::from_bytes`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let saved: SavedRecord = opened(STEP_MARK, bytes)?;
        Ok(Self {
            step: saved.step.restore()?,
            options: saved.options,
            gain: saved.gain,
            scale: saved.scale,
            frame: saved.frame.map(SavedFrame::restore).transpose()?.map(Arc::new),
            particles: saved.particles,
        })
    }
}

fn damaged(got: &str) -> Error {
    Error::argument("state", "the bytes of a pickled particle tracker or step", got)
}

fn sealed(mark: [u8; 4], content: &impl Serialize) -> Vec<u8> {
    let head = [&mark[..], &LAYOUT.to_le_bytes()].concat();
    // Only what has no known length, or an allocation, could fail.
    let mut bytes = postcard::to_extend(content, head).expect("lists of known length");
    bytes.extend(checksum(&bytes).to_le_bytes());
    bytes
}

fn opened<T: DeserializeOwned>(mark: [u8; 4], bytes: &[u8]) -> Result<T> {
    if bytes.len() < HEAD + TAIL || bytes[..4] != mark {
        return Err(damaged("bytes of another kind"));
    }
    let layout = u16::from_le_bytes([bytes[4], bytes[5]]);
    if layout != LAYOUT {
        return Err(damaged(&format!("those of another version (layout {layout}, this one reads {LAYOUT})")));
    }
    let (content, tail) = bytes.split_at(bytes.len() - TAIL);
    if checksum(content).to_le_bytes() != tail {
        return Err(damaged("damaged bytes"));
    }
    postcard::from_bytes(&content[HEAD..]).map_err(|error| damaged(&error.to_string()))
}

/// FNV-1a of 64 bits (G. Fowler, L. C. Noll, K.-P. Vo, D. Eastlake, "The FNV Non-Cryptographic Hash
/// Algorithm"): any one changed byte changes it.
fn checksum(bytes: &[u8]) -> u64 {
    const OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
    const PRIME: u64 = 0x0000_0100_0000_01b3;
    bytes.iter().fold(OFFSET, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(PRIME))
}
