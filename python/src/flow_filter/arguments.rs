//! The options of `FlowFilter`, and the core's options that they mean.

use crate::errors::Outcome;
use crate::options::{self, Group, Integer, Object};
use crate::{arrays, keywords::keep_options, keywords::with_common};
use jacoflow::error::{Error, shape_text};
use jacoflow::filter::SigmaPoints;
use jacoflow::temporal::{FilterForm, FlowFilterOptions, SquareRoot, Transition};
use pyo3::prelude::*;

/// Hands the options of the filter to `$then!`.
macro_rules! filter_options {
    ($then:ident $target:tt) => {
        with_common! {
            $then $target
            profile: Object as Object = None,
            covariance: bool as bool = true,
        }
    };
}
pub(super) use filter_options;

filter_options!(keep_options[Arguments]);

/// Twelve numbers, one for each component of the state.
fn twelve(group: &Group<'_>, name: &'static str, default: [f64; 12]) -> Outcome<[f64; 12]> {
    let Some(value) = group.get::<Bound<'_, PyAny>>(name)? else { return Ok(default) };
    let (shape, values) = arrays::doubles(name, &value)?;
    values.try_into().map_err(|_| {
        Error::argument(name, "twelve numbers, shape (12,)", format!("shape {}", shape_text(&shape))).into()
    })
}

impl Arguments {
    /// With copies of the arrays, safe from later changes.
    pub fn keep(mut self, py: Python<'_>) -> Outcome<Self> {
        for (name, object) in [
            ("profile", &mut self.profile),
            ("grid", &mut self.grid),
            ("mask", &mut self.mask),
            ("preprocess", &mut self.preprocess),
        ] {
            *object = options::keep(py, name, object.take())?;
        }
        Ok(self)
    }

    /// The name of the profile, and the options that replace its own.
    pub fn profile<'py>(&self, py: Python<'py>) -> Outcome<(String, Group<'py>)> {
        if let Some(name) = options::word(py, &self.profile) {
            return Ok((name, Group::new(py, "profile", &[], &None)?));
        }
        let group = Group::new(py, "profile", &["FilterProfile"], &self.profile)?;
        Ok((group.get("name")?.unwrap_or_else(|| "patent".into()), group))
    }

    /// The core's options; `full_scale` stays that of the profile unless it was given.
    pub fn options(&self, py: Python<'_>) -> Outcome<FlowFilterOptions> {
        let (name, group) = self.profile(py)?;
        let base = FlowFilterOptions::profile(&name)?;
        let word = |name| group.get::<String>(name);
        let points = base.sigma_points;
        let pixels = group.get::<Bound<'_, PyAny>>("neighbourhood")?;
        let pixels = pixels.as_ref().map(options::neighbourhood).transpose()?.unwrap_or(base.neighbourhood);
        Ok(FlowFilterOptions {
            neighbourhood: pixels.weighted(group.get("neighbourhood_sigma")?),
            form: word("form")?.map_or(Ok(base.form), |name| FilterForm::parse(&name))?,
            transition: word("transition")?.map_or(Ok(base.transition), |name| Transition::parse(&name))?,
            square_root: word("square_root")?.map(|name| SquareRoot::parse(&name)).transpose()?,
            process_noise: twelve(&group, "Q", base.process_noise)?,
            measurement_noise: group.get("R")?.unwrap_or(base.measurement_noise),
            adaptive: group.get("adaptive")?.unwrap_or(base.adaptive),
            initial_mean: twelve(&group, "x0", base.initial_mean)?,
            initial_covariance: twelve(&group, "P0", base.initial_covariance)?,
            sigma_points: SigmaPoints::new(
                group.get("alpha")?.unwrap_or(points.alpha),
                group.get("beta")?.unwrap_or(points.beta),
                group.get("kappa")?.unwrap_or(points.kappa),
            )?,
            full_scale: group.get("full_scale")?.unwrap_or(base.full_scale),
            preprocess: base.preprocess,
            sites: options::grid(py, &self.grid)?,
            mask: self.mask.as_ref().map(|mask| arrays::mask(mask.bind(py))).transpose()?,
            covariance: self.covariance,
            units: options::units(py, &self.pixel_pitch, self.length_unit.as_deref(), &self.fps)?,
            threads: options::threads(self.threads)?,
            simd: options::simd(self.simd.as_deref())?,
        })
    }
}
