//! The options of `estimate` and `FlowEstimator`, and the core's options that they mean.

use crate::errors::Outcome;
use crate::frame_list::Noted;
use crate::options::{self, Group, Integer, Object, PreprocessOptions};
use crate::{arrays, image::renamed, io::flow_image, keywords::keep_options, keywords::with_common};
use jacoflow::error::Error;
use jacoflow::flow::{Estimator, EstimatorOptions, InitialFlow, METHODS, Method, MethodInfo, MethodSettings, PAIR};
use jacoflow::temporal::{AnyFlowStream, RecursiveOptions, StreamPlan};
use pyo3::prelude::*;
use pyo3::types::PyFloat;
use std::sync::Arc;

/// Hands the options of an estimator to `$then!`.
macro_rules! estimator_options {
    ($then:ident $target:tt) => {
        with_common! {
            $then $target
            method: Object as Object = None,
            initial: Object as Object = None,
            temporal: Object as Object = None,
            covariance: Option<bool> as Option<bool> = None,
            noise: Object as Object = None,
            diagnostics: bool as bool = false,
        }
    };
}
pub(super) use estimator_options;

estimator_options!(keep_options[Arguments]);

/// The classes of `method`.
const METHOD_CLASSES: [&str; 5] = ["CoarseToFine", "Windowed", "Instantaneous", "LucasKanade", "HornSchunck"];
const _: () = assert!(METHOD_CLASSES.len() == METHODS.len());

impl Arguments {
    /// With copies of the arrays, safe from later changes.
    pub fn keep(mut self, py: Python<'_>) -> Outcome<Self> {
        for (name, object) in [
            ("method", &mut self.method),
            ("initial", &mut self.initial),
            ("temporal", &mut self.temporal),
            ("grid", &mut self.grid),
            ("mask", &mut self.mask),
            ("preprocess", &mut self.preprocess),
        ] {
            *object = options::keep(py, name, object.take())?;
        }
        Ok(self)
    }

    /// The stream that the options mean; errors name the arguments as Python knows them. `is_pair`: there are
    /// two frames only, so that a method that takes pairs takes this one unless it has a time scheme.
    pub fn stream(&self, py: Python<'_>, is_pair: bool) -> Outcome<AnyFlowStream> {
        let preprocess = PreprocessOptions::new(py, &self.preprocess)?;
        let mut settings = self.settings(py)?;
        settings.smooth = preprocess.smooth;
        if is_pair && settings.time_scheme.is_none() && MethodInfo::named(&settings.method)?.takes_pairs() {
            settings.time_scheme = Some(PAIR.into());
        }
        let recursive = self.recursive(py)?;
        let method = settings.method()?;
        let common = self.common(py, &method, recursive.is_some())?;
        let steps = preprocess.steps(common.mask.as_ref())?;
        let estimator = Estimator::new(method, common)
            .map_err(|e| renamed(renamed(e, "sigma", "window_sigma"), "window", "window_sigma"))
            .map_err(|e| renamed(e, "presmooth", "smooth"))?;
        let precision = options::precision(self.precision.as_deref())?;
        Ok(AnyFlowStream::new(StreamPlan::new(estimator, steps, recursive)?, precision))
    }

    /// Takes the units that a file notes where no option gives them; returns the times of its frames, s,
    /// empty where they are unknown or `fps` replaces them.
    pub fn take_units<'a>(&mut self, py: Python<'_>, noted: &'a Noted) -> Outcome<&'a [f64]> {
        if let (None, Some((pitch, unit))) = (&self.pixel_pitch, &noted.pixel_size) {
            self.pixel_pitch = Some(pitch.into_pyobject(py)?.into_any().unbind());
            self.length_unit = self.length_unit.take().or_else(|| unit.clone());
        }
        if self.fps.is_some() {
            return Ok(&[]);
        }
        self.fps = noted.frame_rate.map(|rate| PyFloat::new(py, rate).into_any().unbind());
        Ok(&noted.times)
    }

    /// What is done with colour.
    pub fn colour(&self, py: Python<'_>) -> Outcome<arrays::ColourRule> {
        Ok(PreprocessOptions::new(py, &self.preprocess)?.colour)
    }

    /// The method and its options, before any check.
    pub fn settings(&self, py: Python<'_>) -> Outcome<MethodSettings> {
        if let Some(method) = options::word(py, &self.method) {
            if METHODS.iter().flat_map(|method| method.presets).any(|preset| preset.name() == method) {
                let expected = format!("a method or CoarseToFine(preset={method:?})");
                return Err(Error::argument("method", expected, format!("the preset {method:?}")).into());
            }
            return Ok(MethodSettings { method, ..MethodSettings::default() });
        }
        let group = Group::new(py, "method", &METHOD_CLASSES, &self.method)?;
        let count = |name| group.get(name)?.map(|n| options::count(name, n)).transpose();
        let neighbourhood = group.get::<Bound<'_, PyAny>>("neighbourhood")?;
        let default = MethodSettings::default();
        Ok(MethodSettings {
            method: group.get("method")?.unwrap_or(default.method),
            preset: group.get("preset")?,
            levels: count("levels")?,
            model: group.get("model")?,
            time_scheme: group.get("time_scheme")?,
            neighbourhood: neighbourhood.as_ref().map(options::neighbourhood).transpose()?,
            neighbourhood_sigma: group.get("neighbourhood_sigma")?,
            window_sigma: group.get("window_sigma")?,
            rows: group.get("rows")?,
            smoothness: group.get("smoothness")?,
            iterations: count("iterations")?,
            rank_deficient: group.get("rank_deficient")?,
            smooth: default.smooth,
        })
    }

    fn recursive(&self, py: Python<'_>) -> Outcome<Option<RecursiveOptions>> {
        if let Some(word) = options::word(py, &self.temporal) {
            return Ok(RecursiveOptions::parse(Some(&word), None)?);
        }
        let group = Group::new(py, "temporal", &["Recursive"], &self.temporal)?;
        let word = self.temporal.as_ref().map(|_| "recursive");
        Ok(RecursiveOptions::parse(word, group.get("forgetting")?)?)
    }

    fn common(&self, py: Python<'_>, method: &Method, systematic: bool) -> Outcome<EstimatorOptions> {
        Ok(EstimatorOptions {
            sites: options::grid(py, &self.grid)?,
            mask: self.mask.as_ref().map(|mask| arrays::mask(mask.bind(py))).transpose()?,
            initial: self.initial.as_ref().map(|flow| initial(flow.bind(py))).transpose()?,
            units: options::units(py, &self.pixel_pitch, self.length_unit.as_deref(), &self.fps)?,
            covariance: self.covariance.unwrap_or(method.info().has_covariance),
            systematic,
            diagnostics: self.diagnostics,
            noise: options::real(py, "noise", &self.noise)?,
            threads: options::threads(self.threads)?,
            simd: options::simd(self.simd.as_deref())?,
        })
    }
}

/// The flow that an estimate starts from.
fn initial(flow: &Bound<'_, PyAny>) -> Outcome<Arc<InitialFlow>> {
    let image = flow_image("initial", flow)?;
    Ok(Arc::new(InitialFlow::new((image.width(), image.height()), image.u(), image.v())?))
}
