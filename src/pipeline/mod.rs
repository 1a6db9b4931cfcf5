//! From a frame source to files, one frame at a time: source, preparation, estimator or filter,
//! sinks; and, with trackers in their place, to tracks ([`TrackRun`], of colour frames [`ParticleRun`]); and
//! from pairs of views to tracks of everything that moves ([`StereoRun`]).
//!
//! `run` loops over `prefetch` (the reader's thread), `stage` (preparation, estimator or filter) and `sink`
//! (files); `output` decides where results go, `album` writes pictures. `track`, `particle` and `stereo` are
//! the loops with trackers.
//!
//! The memory a [`Pipeline`] needs does not depend on the length of the sequence: at most [`READ_AHEAD`]
//! frames wait behind the reader, and a stage keeps the few frames that it needs (figures 1 and 2 of
//! WO2010/098160). Frames are read and decoded on a thread of their own while the stage works; results come
//! in the order of the frames and do not depend on timing.

mod album;
mod output;
mod particle;
mod prefetch;
mod run;
mod sink;
mod stage;
mod stereo;
mod track;

pub use output::{OutputPlan, OutputWish, PictureKind, Place, check_target, is_device, is_folder};
pub use particle::{
    BeginParticleSinks, ForegroundMaps, ParticleFrame, ParticleRows, ParticleRun, ParticleSink, TargetStart,
};
pub use prefetch::{FirstFrame, READ_AHEAD, peek};
pub use run::{Numbering, Pipeline, Summary};
pub use sink::{
    Collect, Egomotion, EgomotionPlan, Ending, FieldSink, Fields, MeasuredRegion, Measurements, PictureRanges,
    Pictures, Rows, Sink, Step, Table, TableTarget, TextFormat,
};
pub use stage::{FilterStage, Output, Stage};
pub use stereo::{
    BeginSinks, ClusterRows, GraphChart, GraphFile, GreyPair, GreyPairs, PairTimes, StereoFormat, StereoOverlays,
    StereoPicture, StereoRun, StereoSink, StereoStep, StereoSummary,
};
pub use track::{
    Begin, Begun, Overlays, PATH_LENGTH, TargetSummary, TrackFormat, TrackRows, TrackRun, TrackSink, TrackStep,
    TrackSummary,
};
