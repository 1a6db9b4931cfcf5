//! The everyday estimator: affine flow from coarse to fine, for motions of many pixels, edges between motions
//! and untextured areas.
//!
//! A pyramid of the frames is walked from its coarsest level. On each level the motion at every second pixel
//! is improved a few times: the frames are warped by it towards the middle of their times (`data`: rows 1 to
//! 3 of WO2010/098160, (21), transported, over a small window), and neighbouring sites are bound together,
//! robustly (`couple`). On the finest level the windows that the motion may be averaged over are chosen site
//! by site (`refine`), the pull of undersampled texture is taken out (`locking`), and the covariance follows
//! from all this (`covariance`). `docs/theory.md` tells why.
//!
//! Flow of a pair belongs to the pixels of the first frame. Every pixel with data gets an estimate; what is
//! untextured or leaves the frame is filled from its surroundings. Fine random texture that moves by more
//! than its own grain on every level of the pyramid may not be found. The covariance does not know of motions
//! that were not found, nor of what happens at motion boundaries.

mod candidates;
mod change;
mod couple;
mod covariance;
mod data;
mod descend;
mod further;
mod grid;
mod levels;
mod locking;
mod memory;
mod options;
mod output;
mod range;
mod reference;
mod refine;
mod resample;
mod rows;
mod run;
mod step;

pub use options::{CoarseToFineOptions, LEAST_SIDE, Preset};
pub(super) use run::CoarseToFine;

/// How far errors of neighbouring estimates from so many frames go together, px: that of wide windows, so
/// that means over regions are not told too well. Those of three frames, whose windows are chosen once more
/// in what they have made smooth, go together further.
pub(super) fn correlation_length(frames: usize) -> f64 {
    if frames == 3 { 17.0 } else { 8.0 }
}
