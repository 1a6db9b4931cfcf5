//! What `FlowFilter` is told, and the core options that it means.

use crate::error::Error;
use crate::filter::SigmaPoints;
use crate::python::arrays;
use crate::python::keywords::{keep_options, with_common};
use crate::python::options::{self, Integer, Object, Region};
use crate::temporal::{FilterForm, FlowFilterOptions, SquareRoot, Transition};
use pyo3::prelude::*;

/// Hands the options of the filter to `$then!`.
macro_rules! filter_options {
    ($then:ident $target:tt) => {
        with_common! {
            $then $target
            profile: String as &str = "patent",
            form: Option<String> as Option<String> = None,
            transition: Option<String> as Option<String> = None,
            square_root: Option<String> as Option<String> = None,
            neighbourhood: Object as Object = None,
            neighbourhood_sigma: Option<f64> as Option<f64> = None,
            Q: Object as Object = None,
            R: Option<f64> as Option<f64> = None,
            x0: Object as Object = None,
            P0: Object as Object = None,
            alpha: Option<f64> as Option<f64> = None,
            beta: Option<f64> as Option<f64> = None,
            kappa: Option<f64> as Option<f64> = None,
            full_scale: Option<f64> as Option<f64> = None,
            covariance: bool as bool = true,
        }
    };
}
pub(super) use filter_options;

filter_options!(keep_options[Arguments]);

/// Twelve numbers, one for each component of the state.
fn twelve(py: Python<'_>, name: &'static str, value: &Object, default: [f64; 12]) -> PyResult<[f64; 12]> {
    let Some(value) = value else { return Ok(default) };
    let (shape, values) = arrays::doubles(name, value.bind(py))?;
    values
        .try_into()
        .map_err(|_| Error::argument(name, "twelve numbers, shape (12,)", format!("shape {shape:?}")).into())
}

impl Arguments {
    /// With copies of the arrays, safe from later changes.
    pub fn keep(mut self, py: Python<'_>) -> PyResult<Self> {
        let kept = [&mut self.neighbourhood, &mut self.Q, &mut self.x0, &mut self.P0, &mut self.points, &mut self.mask];
        for object in kept {
            *object = options::keep(py, object.take())?;
        }
        Ok(self)
    }

    /// The core's options; `full_scale` stays that of the profile unless it was given.
    pub fn options(&self, py: Python<'_>) -> PyResult<FlowFilterOptions> {
        let base = match self.profile.as_str() {
            "patent" => FlowFilterOptions::patent(),
            "measured" => FlowFilterOptions::measured(),
            other => {
                let expected = "\"patent\" or \"measured\"";
                return Err(Error::argument("profile", expected, format!("{other:?}")).into());
            }
        };
        let points = base.sigma_points;
        Ok(FlowFilterOptions {
            neighbourhood: options::neighbourhood(
                py,
                &self.neighbourhood,
                self.neighbourhood_sigma,
                &base.neighbourhood,
            )?,
            form: self.form.as_deref().map_or(Ok(base.form), FilterForm::parse)?,
            transition: self.transition.as_deref().map_or(Ok(base.transition), Transition::parse)?,
            square_root: self.square_root.as_deref().map(SquareRoot::parse).transpose()?,
            process_noise: twelve(py, "Q", &self.Q, base.process_noise)?,
            measurement_noise: self.R.unwrap_or(base.measurement_noise),
            initial_mean: twelve(py, "x0", &self.x0, base.initial_mean)?,
            initial_covariance: twelve(py, "P0", &self.P0, base.initial_covariance)?,
            sigma_points: SigmaPoints::new(
                self.alpha.unwrap_or(points.alpha),
                self.beta.unwrap_or(points.beta),
                self.kappa.unwrap_or(points.kappa),
            )?,
            full_scale: self.full_scale.unwrap_or(base.full_scale),
            sites: options::sites(py, &self.points, self.region, self.stride)?,
            mask: self.mask.as_ref().map(|mask| arrays::mask(mask.bind(py))).transpose()?,
            covariance: self.covariance,
            residual: base.residual,
            pixel_pitch: options::pixel_pitch(py, &self.pixel_pitch)?.unwrap_or(base.pixel_pitch),
            frame_period: options::frame_period(self.fps, self.frame_period)?,
            threads: options::threads(self.threads)?,
            simd: options::simd(self.simd.as_deref())?,
        })
    }
}
