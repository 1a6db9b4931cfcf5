//! The public interface, system by system, in one binary: each would be linked to the library on its own.

// Printed on purpose: figures reached are part of the answer, and a skipped recording is said.
#![allow(clippy::print_stdout)]

// As the library's own files name it, which the guide's example is one of.
use jacoflow::jet;

mod affine_flow;
mod cli;
mod coarse_to_fine;
mod conventions;
mod filter;
mod image;
mod io;
mod mixture;
mod motion3d;
mod pipeline;
mod segment;
mod stereo;
mod synth;
mod temporal;
mod track;
mod windowed;
