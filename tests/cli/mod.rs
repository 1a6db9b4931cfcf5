//! The binary, end to end: real processes, real files, exit codes.

mod support;

mod commands;
mod egomotion;
mod mistakes;
mod particle;
mod recordings;
mod stereo;
mod stereo_tracks;
mod streams;
mod tracks;
