//! Options of the stereo tracker as Python gives them.

use crate::error::Error;
use crate::parallel::Threads;
use crate::stereo::Method;
use crate::track::stereo::{Grouping, Recognition, StereoCamera, StereoMode, StereoTrackerOptions};
use pyo3::prelude::*;

/// The keyword options of `jacoflow.track.StereoTracker`; none: the mode's default.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(super) struct Given {
    mode: String,
    n_components: Option<usize>,
    weight_concentration_prior: f64,
    mean_precision_prior: f64,
    degrees_of_freedom_prior: f64,
    covariance_prior: f64,
    max_iter: usize,
    warm_max_iter: usize,
    tol: Tolerance,
    n_init: usize,
    prune_weight: f64,
    random_state: u64,
    disparity_range: [i32; 2],
    row_range: [i32; 2],
    row_offset: Option<f64>,
    matching: Option<String>,
    grid: (usize, usize, Option<usize>),
    search: usize,
    luminance_levels: usize,
    arc_threshold: f64,
    reseed_below: f64,
    recognition: Option<bool>,
    least_overlap: f64,
    patience: usize,
    tolerance: [f64; 3],
    tolerance_per_step: [f64; 3],
    coast: usize,
    jump: (f64, f64),
    grouping: Option<bool>,
    group_limits: (f64, f64, f64),
    focal: Option<f64>,
    baseline: Option<f64>,
    d_infinity: f64,
    step_time: f64,
    threads: Option<usize>,
}

/// `tol="auto"`, a number or None.
#[derive(FromPyObject)]
enum Tolerance {
    Word(String),
    Number(Option<f64>),
}

impl Given {
    pub(super) fn options(self) -> PyResult<StereoTrackerOptions> {
        let Some(mode) = StereoMode::ALL.into_iter().find(|mode| mode.name() == self.mode) else {
            return Err(Error::argument("mode", "\"improved\" or \"paper\"", format!("{:?}", self.mode)).into());
        };
        let camera = self.camera()?;
        let mut options = StereoTrackerOptions::new(mode);
        options.tol = match self.tol {
            Tolerance::Number(tol) => tol,
            Tolerance::Word(word) if word == "auto" => options.tol,
            Tolerance::Word(word) => {
                return Err(Error::argument("tol", "\"auto\", a number or None", format!("{word:?}")).into());
            }
        };
        options = options.with_disparities(self.disparity_range);
        let (rows, columns, layers) = self.grid;
        options.grid.rows = rows;
        options.grid.columns = columns;
        options.grid.layers = layers.unwrap_or(options.grid.layers);
        options.row_range = self.row_range;
        options.row_offset = self.row_offset;
        if let Some(matching) = self.matching {
            options.matching = Method::ALL
                .into_iter()
                .find(|method| method.name() == matching)
                .ok_or_else(|| Error::argument("matching", "\"classes\" or \"sgm\"", format!("{matching:?}")))?;
        }
        options.components = self.n_components.unwrap_or(options.components);
        options.weight_concentration_prior = self.weight_concentration_prior;
        options.mean_precision_prior = self.mean_precision_prior;
        options.degrees_of_freedom_prior = self.degrees_of_freedom_prior;
        options.covariance_prior = self.covariance_prior;
        options.max_iter = self.max_iter;
        options.warm_max_iter = self.warm_max_iter;
        options.n_init = self.n_init;
        options.prune_weight = self.prune_weight;
        options.random_state = self.random_state;
        options.search = self.search;
        options.luminance_levels = self.luminance_levels;
        options.arc_threshold = self.arc_threshold;
        options.reseed_below = self.reseed_below;
        let wanted = (
            self.recognition.unwrap_or(options.recognition.is_some()),
            self.grouping.unwrap_or(options.grouping.is_some()),
        );
        let limits = Recognition {
            least_overlap: self.least_overlap,
            patience: self.patience,
            tolerance: self.tolerance,
            tolerance_per_step: self.tolerance_per_step,
            coast: self.coast,
            jump: self.jump.0,
            jump_disparity: self.jump.1,
            ..Recognition::default()
        };
        let (reach, motion, depth_motion) = self.group_limits;
        let grouping = Grouping { reach, motion, depth_motion };
        // What is given is checked, be it used or not.
        (options.recognition, options.grouping) = (Some(limits), Some(grouping));
        options.check()?;
        (options.recognition, options.grouping) = (wanted.0.then_some(limits), wanted.1.then_some(grouping));
        options.camera = camera;
        options.step_time = self.step_time;
        options.threads = Threads::new(self.threads)?;
        Ok(options)
    }
    /// The cameras, where both lengths were given; what was given of them is checked first.
    fn camera(&self) -> PyResult<Option<StereoCamera>> {
        let (focal, baseline) = (self.focal.unwrap_or(1.0), self.baseline.unwrap_or(1.0));
        let camera = StereoCamera { focal, baseline, d_infinity: self.d_infinity };
        camera.check()?;
        match (self.focal, self.baseline) {
            (Some(_), Some(_)) => Ok(Some(camera)),
            (None, None) => Ok(None),
            (None, Some(_)) => Err(Error::argument("focal", "a length in px beside the baseline", "None").into()),
            (Some(_), None) => Err(Error::argument("baseline", "a length beside the focal length", "None").into()),
        }
    }
}
