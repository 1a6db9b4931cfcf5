//! The binary, end to end: real processes, real files, exit codes.

// Printed on purpose: a skipped recording is said.
#![allow(clippy::print_stdout)]

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
