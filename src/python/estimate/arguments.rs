//! What `estimate` and `FlowEstimator` are told, and the core options that it means.

use crate::error::{Error, Result};
use crate::flow::baseline::{Differences, HornSchunckOptions, LucasKanadeOptions, Smoothness, Window};
use crate::flow::coarse_to_fine::{CoarseToFineOptions, Preset};
use crate::flow::instantaneous::InstantaneousOptions;
use crate::flow::model::ModelKind;
use crate::flow::windowed::{RowSet, WindowedOptions};
use crate::flow::{Estimator, EstimatorOptions, Method, RankPolicy};
use crate::image::Preprocess;
use crate::jet::{Neighbourhood, TimeScheme};
use crate::python::arrays::{self, ColourRule};
use crate::python::image::renamed;
use crate::python::keywords::{keep_options, with_common};
use crate::python::options::{self, Integer, Object, Precision, Region};
use crate::temporal::{RecursiveFusion, RecursiveOptions};
use pyo3::prelude::*;

/// Hands the options of an estimator to `$then!`.
macro_rules! estimator_options {
    ($then:ident $target:tt) => {
        with_common! {
            $then $target
            method: String as &str = "coarse_to_fine",
            preset: Option<String> as Option<String> = None,
            levels: Option<Integer> as Option<Integer> = None,
            model: String as &str = "affine",
            time_scheme: Option<String> as Option<String> = None,
            neighbourhood: Object as Object = None,
            neighbourhood_sigma: Option<f64> as Option<f64> = None,
            window_sigma: Option<f64> as Option<f64> = None,
            rows: Option<String> as Option<String> = None,
            smoothness: Option<f64> as Option<f64> = None,
            iterations: Option<Integer> as Option<Integer> = None,
            rank_deficient: String as &str = "nan",
            covariance: Option<bool> as Option<bool> = None,
            diagnostics: bool as bool = false,
            noise: Option<f64> as Option<f64> = None,
            temporal: Option<String> as Option<String> = None,
            forgetting: Option<f64> as Option<f64> = None,
        }
    };
}
pub(super) use estimator_options;

estimator_options!(keep_options[Arguments]);

/// The time scheme of two frames.
pub const PAIR: &str = "pair";

/// Everything that a sequence of frames goes through.
pub struct Plan {
    pub estimator: Estimator,
    pub preprocess: Preprocess,
    pub colour: ColourRule,
    pub precision: Precision,
    /// How estimates are fused over time, if they are.
    pub recursive: Option<RecursiveOptions>,
}

impl Arguments {
    /// With copies of the arrays, safe from later changes.
    pub fn keep(mut self, py: Python<'_>) -> PyResult<Self> {
        self.neighbourhood = options::keep(py, self.neighbourhood)?;
        self.points = options::keep(py, self.points)?;
        self.mask = options::keep(py, self.mask)?;
        Ok(self)
    }

    /// The core's options; errors name the arguments as Python knows them.
    pub fn plan(&self, py: Python<'_>) -> PyResult<Plan> {
        let method = self.method(py)?;
        let common = self.common(py, !matches!(method, Method::HornSchunck(_)))?;
        let mut preprocess = options::preprocess(self.smooth, self.quantise, common.mask.as_ref())?;
        if matches!(method, Method::Windowed(_)) {
            // It smooths on its own, and reads the noise from the frames before that.
            preprocess.smooth = None;
        }
        let recursive = RecursiveOptions::parse(self.temporal.as_deref(), self.forgetting)?;
        let estimator = Estimator::new(method, common)
            .map_err(|e| renamed(renamed(e, "sigma", "window_sigma"), "window", "window_sigma"))
            .map_err(|e| renamed(e, "presmooth", "smooth"))?;
        if let Some(options) = recursive {
            // What it cannot be used with is told now, and not with the first field.
            RecursiveFusion::<f32>::new(&estimator, options)?;
        }
        Ok(Plan {
            recursive,
            estimator,
            preprocess,
            colour: ColourRule::parse(self.colour.as_deref())?,
            precision: Precision::parse(self.precision.as_deref())?,
        })
    }

    /// Whether the method can make do with two frames.
    pub fn takes_pairs(&self) -> bool {
        !matches!(Method::parse(&self.method), Ok(Method::Instantaneous(_)))
    }

    fn common(&self, py: Python<'_>, has_covariance: bool) -> PyResult<EstimatorOptions> {
        let default = EstimatorOptions::default();
        Ok(EstimatorOptions {
            sites: options::sites(py, &self.points, self.region, self.stride)?,
            mask: self.mask.as_ref().map(|mask| arrays::mask(mask.bind(py))).transpose()?,
            pixel_pitch: options::pixel_pitch(py, &self.pixel_pitch)?.unwrap_or(default.pixel_pitch),
            frame_period: options::frame_period(self.fps, self.frame_period)?,
            covariance: self.covariance.unwrap_or(has_covariance),
            systematic: self.temporal.as_deref() == Some("recursive"),
            diagnostics: self.diagnostics,
            noise: self.noise,
            threads: options::threads(self.threads)?,
            simd: options::simd(self.simd.as_deref())?,
        })
    }

    fn method(&self, py: Python<'_>) -> PyResult<Method> {
        let mut method = Method::parse(&self.method)?;
        let fit = |default: &Neighbourhood| {
            options::neighbourhood(py, &self.neighbourhood, self.neighbourhood_sigma, default)
        };
        if !matches!(method, Method::CoarseToFine(_)) {
            self.refuse(&["preset", "levels"])?;
        }
        match &mut method {
            Method::CoarseToFine(o) => self.coarse_to_fine(o)?,
            Method::Instantaneous(o) => self.instantaneous(o, fit(&o.neighbourhood)?)?,
            Method::Windowed(o) => self.windowed(o, fit(&o.neighbourhood)?)?,
            Method::LucasKanade(o) => self.lucas_kanade(o)?,
            Method::HornSchunck(o) => self.horn_schunck(o)?,
        }
        Ok(method)
    }

    fn coarse_to_fine(&self, o: &mut CoarseToFineOptions) -> PyResult<()> {
        self.refuse(&["neighbourhood", "window_sigma", "rows", "smoothness", "iterations", "rank_deficient"])?;
        self.expect_model("affine")?;
        match self.time_scheme.as_deref() {
            None => {}
            Some(PAIR) => o.frames = 2,
            Some(name) => o.set_scheme(name).map_err(|_| unknown_scheme(self, "forward, central or pair"))?,
        }
        o.preset = self.preset.as_deref().map_or(Ok(o.preset), Preset::parse)?;
        o.levels = self.levels.map(|levels| options::count("levels", levels)).transpose()?;
        Ok(())
    }

    fn instantaneous(&self, o: &mut InstantaneousOptions, neighbourhood: Neighbourhood) -> Result<()> {
        self.refuse(&["window_sigma", "rows", "smoothness", "iterations"])?;
        o.model = ModelKind::parse(&self.model)?;
        o.neighbourhood = neighbourhood;
        o.scheme = self.scheme(o.scheme)?;
        o.rank_deficient = RankPolicy::parse(&self.rank_deficient)?;
        Ok(())
    }

    fn windowed(&self, o: &mut WindowedOptions, neighbourhood: Neighbourhood) -> Result<()> {
        self.refuse(&["smoothness", "iterations"])?;
        self.expect_model("affine")?;
        if self.time_scheme.as_deref() == Some(PAIR) {
            *o = WindowedOptions::pair();
        } else {
            o.scheme = self.scheme(o.scheme)?;
        }
        o.neighbourhood = neighbourhood;
        o.sigma = self.window_sigma.unwrap_or(o.sigma);
        o.rows = self.rows.as_deref().map_or(Ok(o.rows), RowSet::parse)?;
        o.rank_deficient = RankPolicy::parse(&self.rank_deficient)?;
        if let Some(sigma) = self.smooth {
            o.presmooth = Some(sigma).filter(|&sigma| sigma > 0.0);
        }
        Ok(())
    }

    fn lucas_kanade(&self, o: &mut LucasKanadeOptions) -> Result<()> {
        self.refuse(&["neighbourhood", "rows", "smoothness", "iterations", "rank_deficient"])?;
        self.expect_model("translational")?;
        o.window = self.window_sigma.map_or(o.window, Window::Gaussian);
        o.differences = self.differences(o.differences)?;
        Ok(())
    }

    fn horn_schunck(&self, o: &mut HornSchunckOptions) -> PyResult<()> {
        self.refuse(&["neighbourhood", "window_sigma", "rows", "rank_deficient"])?;
        self.expect_model("translational")?;
        o.smoothness = self.smoothness.map_or(o.smoothness, Smoothness::Relative);
        if let Some(iterations) = self.iterations {
            o.iterations = options::count("iterations", iterations)?;
        }
        o.differences = self.differences(o.differences)?;
        Ok(())
    }

    fn scheme(&self, default: TimeScheme) -> Result<TimeScheme> {
        let named = self.time_scheme.as_deref().map_or(Ok(default), TimeScheme::parse);
        named.map_err(|_| unknown_scheme(self, "central, backward or pair"))
    }

    fn differences(&self, default: Differences) -> Result<Differences> {
        let named = self.time_scheme.as_deref().map_or(Ok(default), Differences::parse);
        named.map_err(|_| unknown_scheme(self, "central or pair"))
    }

    /// Baselines and the windowed method have one model each; "affine" is also what everybody gets who does
    /// not choose.
    fn expect_model(&self, only: &str) -> Result<()> {
        ModelKind::parse(&self.model)?;
        if self.model == only || self.model == ModelKind::default().name() {
            return Ok(());
        }
        Err(Error::argument("model", format!("{only:?} for method {:?}", self.method), format!("{:?}", self.model)))
    }

    /// Options that the method does not have must not have been given.
    fn refuse(&self, names: &[&'static str]) -> Result<()> {
        for &name in names {
            let given = match name {
                "preset" => self.preset.is_some(),
                "levels" => self.levels.is_some(),
                "neighbourhood" => self.neighbourhood.is_some() || self.neighbourhood_sigma.is_some(),
                "window_sigma" => self.window_sigma.is_some(),
                "rows" => self.rows.is_some(),
                "smoothness" => self.smoothness.is_some(),
                "iterations" => self.iterations.is_some(),
                _ => self.rank_deficient != RankPolicy::default().name(),
            };
            if given {
                return Err(Error::argument(name, format!("nothing for method {:?}", self.method), "a value"));
            }
        }
        Ok(())
    }
}

fn unknown_scheme(arguments: &Arguments, known: &str) -> Error {
    let expected = format!("{known} for method {:?}", arguments.method);
    Error::argument("time_scheme", expected, format!("{:?}", arguments.time_scheme.as_deref().unwrap_or_default()))
}
