//! Options of the particle tracker as Python gives them.

use crate::errors::Outcome;
use crate::options::{self, Integer, named};
use crate::track::word;
use jacoflow::error::Error;
use jacoflow::filter::particle::Resampling;
use jacoflow::segment::SegmentOptions;
use jacoflow::track::particle::{ForegroundModel, Likelihoods, ParticleMode, ParticleOptions};
use pyo3::prelude::*;

/// The keyword options of `jacoflow.track.ParticleTracker`.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(super) struct Given {
    mode: String,
    #[pyo3(from_py_with = named::n_particles)]
    n_particles: usize,
    #[pyo3(from_py_with = named::n_near)]
    n_near: usize,
    scale: Option<f64>,
    likelihoods: Option<Vec<String>>,
    resampling: String,
    ess_threshold: f64,
    foreground: String,
    /// Scale, sigma and smallest region.
    segmentation: (f64, f64, Option<usize>),
    grey: String,
    #[pyo3(from_py_with = named::random_state)]
    random_state: u64,
    threads: Option<Integer>,
}

impl Given {
    /// The core's options, and whether grey frames are taken.
    pub(super) fn options(self) -> Outcome<(ParticleOptions, bool)> {
        let takes_grey = word("grey", &self.grey, &[("error", false), ("value", true)])?;
        let (scale, sigma, min_size) = self.segmentation;
        // Its names are entries of the option, not options.
        SegmentOptions { scale, sigma, min_size: min_size.unwrap_or_default() }.check().map_err(
            |error| match error {
                Error::Argument { argument, expected, got } => Error::Argument {
                    argument: "segmentation",
                    expected: format!("a {argument} that is {expected}"),
                    got,
                },
                other => other,
            },
        )?;
        let options = ParticleOptions {
            mode: ParticleMode::parse(&self.mode)?,
            n_particles: self.n_particles,
            n_near: self.n_near,
            scale: self.scale,
            likelihoods: self.likelihoods.map(|names| Likelihoods::from_names(&names)).transpose()?,
            resampling: Resampling::parse(&self.resampling)?,
            ess_threshold: self.ess_threshold,
            foreground: ForegroundModel::parse(&self.foreground)?,
            segment_scale: scale,
            segment_sigma: sigma,
            segment_min_size: min_size,
            random_state: self.random_state,
            threads: options::threads(self.threads)?,
        };
        options.check()?;
        Ok((options, takes_grey))
    }
}
