//! Coarse-to-fine estimator: affine flow for motions of many pixels, motion boundaries and untextured areas.
//!
//! Data pass the stages in this order:
//!
//! 1. [`brightness_scale`], [`pyramid`]: frames are scaled to a common contrast and halved repeatedly. Above
//!    the finest levels, [`brightness_change`] compares the frames along the motion; where gain or offset
//!    differ, frames are equalised and the pyramid is filled again.
//! 2. [`descent`]: from the coarsest level down, each level repeats two steps: [`data_term`] warps the frames
//!    by the present motion and sums windowed normal equations (rows 1 to 3 of WO2010/098160, (21)) at every
//!    second pixel; [`regularize`] minimises data and robust smoothness terms together. [`resample`] carries
//!    the motion to the next level, without its own peak locking.
//! 3. [`refine`]: on the finest level, chooses at each site the window over which the motion is averaged;
//!    three frames are warped by the result and refined once more.
//! 4. [`peak_locking`], [`detail_bias`]: measure and remove the bias of undersampled texture.
//! 5. [`acceleration`]: three frames only; from the mean of both steps to the step after the middle frame.
//! 6. [`unresolved_motion`], [`covariance`]: error sources measured in the same frames.
//! 7. [`output`]: the field at the requested sites, with status and diagnostics, its flow first refined at
//!    every pixel by [`variational`].
//!
//! [`estimator`] runs the stages, [`schedule`] says how much work each level gets, [`estimate`] is what the
//! stages leave for covariance and output. [`planes`], [`extended`], [`plane_pool`] and [`workspace`] hold
//! the memory; [`nodes`] are where errors are described.
//!
//! Flow of a pair belongs to the pixels of the first frame. Every usable pixel gets an estimate; untextured
//! areas and pixels that leave the frame are filled from their surroundings. Fine random texture that moves
//! by more than its grain on every level may not be found. The covariance includes neither motions that were
//! not found nor errors at motion boundaries. `docs/flow.md` has the equations,
//! `docs/design/coarse_to_fine.md` the origin of the constants.

mod acceleration;
mod brightness_change;
mod brightness_scale;
mod covariance;
mod data_term;
mod descent;
mod detail_bias;
mod estimate;
mod estimator;
mod extended;
mod nodes;
mod options;
mod output;
mod peak_locking;
mod plane_pool;
mod planes;
mod pyramid;
mod refine;
mod regularize;
mod resample;
mod schedule;
mod unresolved_motion;
mod variational;
mod workspace;

pub(super) use estimator::CoarseToFine;
pub use options::{CoarseToFineOptions, MIN_LEVEL_SIDE, Preset};

/// Distance, px, over which errors of neighbouring estimates from `frames` frames are correlated: that of
/// wide windows. Windows of three frames are chosen a second time, in a motion that is already smooth.
pub(super) fn correlation_length(frames: usize) -> f64 {
    if frames == 3 { 17.0 } else { 8.0 }
}
