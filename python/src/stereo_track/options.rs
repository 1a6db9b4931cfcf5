//! Options of the stereo tracker as Python gives them.

use crate::errors::Outcome;
use crate::options::{self, Integer, named};
use jacoflow::track::stereo::{StereoCamera, StereoMode, StereoTrackerOptions};
use pyo3::prelude::*;

/// The keyword options of `jacoflow.track.StereoTracker`; none: the mode's default.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(super) struct Given {
    mode: String,
    #[pyo3(from_py_with = named::n_components)]
    n_components: Option<usize>,
    disparity_range: [i32; 2],
    row_range: [i32; 2],
    row_offset: Option<f64>,
    grid: (usize, usize, Option<usize>),
    #[pyo3(from_py_with = named::search)]
    search: usize,
    /// Focal length, baseline and disparity at infinity.
    camera: Option<(f64, f64, f64)>,
    step_time: f64,
    #[pyo3(from_py_with = named::random_state)]
    random_state: u64,
    threads: Option<Integer>,
}

impl Given {
    pub(super) fn options(self) -> Outcome<StereoTrackerOptions> {
        let mut options =
            StereoTrackerOptions::new(StereoMode::parse(&self.mode)?).with_disparities(self.disparity_range);
        let (rows, columns, layers) = self.grid;
        options.grid.rows = rows;
        options.grid.columns = columns;
        options.grid.layers = layers.unwrap_or(options.grid.layers);
        options.row_range = self.row_range;
        options.row_offset = self.row_offset;
        options.n_components = self.n_components.unwrap_or(options.n_components);
        options.search = self.search;
        options.camera = self.camera.map(|(focal, baseline, d_infinity)| StereoCamera { focal, baseline, d_infinity });
        options.step_time = self.step_time;
        options.random_state = self.random_state;
        options.threads = options::threads(self.threads)?;
        options.check()?;
        Ok(options)
    }
}
