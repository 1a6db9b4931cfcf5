//! The binary, end to end: real processes, real files, exit codes.

// Printed on purpose: a skipped recording is said.
#![allow(clippy::print_stdout)]

#[path = "cli/support.rs"]
mod support;

#[path = "cli/commands.rs"]
mod commands;
#[path = "cli/egomotion.rs"]
mod egomotion;
#[path = "cli/mistakes.rs"]
mod mistakes;
#[path = "cli/particle.rs"]
mod particle;
#[path = "cli/recordings.rs"]
mod recordings;
#[path = "cli/stereo.rs"]
mod stereo;
#[path = "cli/stereo_tracks.rs"]
mod stereo_tracks;
#[path = "cli/streams.rs"]
mod streams;
#[path = "cli/tracks.rs"]
mod tracks;
