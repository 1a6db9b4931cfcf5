//! Trackers through the public API: parts of the gradient tracker, grey levels, options and graphs.

mod detect;
mod gauss_markov;
mod grey_levels;
mod particle_options;
mod particle_persist;
mod persist;
#[cfg(feature = "reference")]
mod reference;
mod stereo_graph;
mod stereo_options;
