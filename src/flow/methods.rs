//! The estimators by name: the one table of which options each takes and what each can do.
//!
//! Python, the binding and the command line fill a [`MethodSettings`] with what the user gave and call
//! [`MethodSettings::method`]; all checks and error messages about methods come from here. Option names are
//! those of Python's arguments; the command line writes `-` for `_`. What a method can do is read from
//! [`Method::info`], never from a `match` on the method elsewhere.
//!
//! ```
//! use jacoflow::flow::{METHODS, MethodInfo, MethodSettings};
//! let windowed = MethodSettings { method: "windowed".into(), ..Default::default() };
//! let settings = MethodSettings { window_sigma: Some(3.0), ..windowed.clone() };
//! let method = settings.method()?;
//! assert!(method.info().smooths_frames && method.info().takes_pairs());
//! // An option of another method is an error that names the option and its methods.
//! let wrong = MethodSettings { levels: Some(4), ..windowed };
//! let message = wrong.method().unwrap_err().to_string();
//! assert_eq!(message, "levels: expected method coarse_to_fine, got windowed");
//! // The table itself: names, options, time schemes (the first is the default), models.
//! assert_eq!(METHODS[0].name, "coarse_to_fine");
//! assert!(MethodInfo::named("instantaneous")?.models.len() > 1);
//! # Ok::<(), jacoflow::Error>(())
//! ```
//!
//! A new option of a method is a field of [`MethodSettings`], a line in `MethodSettings::given`, its name in
//! [`METHODS`] and one line in the function that builds the method's options.

use super::baseline::{Differences, HornSchunckOptions, LucasKanadeOptions, Smoothness, Window};
use super::coarse_to_fine::{CoarseToFineOptions, Preset, correlation_length};
use super::instantaneous::InstantaneousOptions;
use super::model::ModelKind;
use super::options::RankPolicy;
use super::windowed::{RowSet, WindowedOptions};
use crate::error::{Error, Result};
use crate::jet::{Neighbourhood, TimeScheme};
use crate::types::Interval;

/// The time scheme of two frames.
pub const PAIR: &str = "pair";

/// One method: its name, the options that it takes in addition to those of all methods, and what it can do.
// A table of capabilities: each is a question of its own.
#[allow(clippy::struct_excessive_bools)]
#[derive(Debug, Clone, Copy)]
pub struct MethodInfo {
    /// The name in Rust and Python; `-` for `_` on the command line.
    pub name: &'static str,
    /// The options of [`MethodSettings`] that the method takes.
    pub options: &'static [&'static str],
    /// Its presets, the cheapest first; empty without any.
    pub presets: &'static [Preset],
    /// Time schemes, the default first. Two frames are the scheme [`PAIR`].
    pub time_schemes: &'static [&'static str],
    /// Motion models, the default first.
    pub models: &'static [ModelKind],
    /// Whether it smooths the frames itself (`smooth`), after it has measured their noise.
    pub smooths_frames: bool,
    /// Whether its fields have a covariance.
    pub has_covariance: bool,
    /// Whether it separates the systematic part of the covariance.
    pub has_systematic: bool,
    /// Whether it chooses the window of the derivatives at each pixel.
    pub chooses_window: bool,
    /// Whether it can start from a given flow.
    pub takes_initial: bool,
}

const USUAL: MethodInfo = MethodInfo {
    name: "",
    options: &[],
    presets: &[],
    time_schemes: &[],
    models: &[ModelKind::Affine],
    smooths_frames: false,
    has_covariance: true,
    has_systematic: false,
    chooses_window: false,
    takes_initial: false,
};

/// Every method, the recommended one first.
pub const METHODS: &[MethodInfo] = &[
    MethodInfo {
        name: "coarse_to_fine",
        options: &["preset", "levels", "time_scheme"],
        presets: &Preset::EVERY,
        time_schemes: &["forward", "central", PAIR],
        has_systematic: true,
        chooses_window: true,
        takes_initial: true,
        ..USUAL
    },
    MethodInfo {
        name: "windowed",
        options: &["time_scheme", "neighbourhood", "neighbourhood_sigma", "window_sigma", "rows", "rank_deficient"],
        time_schemes: &["central", "backward", PAIR],
        smooths_frames: true,
        has_systematic: true,
        ..USUAL
    },
    MethodInfo {
        name: "instantaneous",
        options: &["model", "time_scheme", "neighbourhood", "neighbourhood_sigma", "rank_deficient"],
        time_schemes: &["central", "backward"],
        models: ModelKind::ALL,
        ..USUAL
    },
    MethodInfo {
        name: "lucas_kanade",
        options: &["time_scheme", "window_sigma"],
        time_schemes: &["central", PAIR],
        models: &[ModelKind::Translational],
        ..USUAL
    },
    MethodInfo {
        name: "horn_schunck",
        options: &["time_scheme", "smoothness", "iterations"],
        time_schemes: &["central", PAIR],
        models: &[ModelKind::Translational],
        has_covariance: false,
        ..USUAL
    },
];

impl MethodInfo {
    /// The method called `name`.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `method` for another word.
    pub fn named(name: &str) -> Result<&'static Self> {
        METHODS
            .iter()
            .find(|method| method.name == name)
            .ok_or_else(|| Error::argument("method", alternatives(METHODS.iter().map(|method| method.name)), name))
    }

    /// Whether two frames are enough.
    pub fn takes_pairs(&self) -> bool {
        self.time_schemes.contains(&PAIR)
    }
}

/// The ways to estimate flow from two or three frames.
#[derive(Debug, Clone)]
pub enum Method {
    /// Affine flow from coarse to fine: large motions, edges, untextured areas.
    CoarseToFine(CoarseToFineOptions),
    /// Per pixel, (34): flow and Jacobian from a 3x3x3 block of brightness.
    Instantaneous(InstantaneousOptions),
    /// The same equations summed over a window in which the motion is affine.
    Windowed(WindowedOptions),
    /// Baseline: flow constant in a window.
    LucasKanade(LucasKanadeOptions),
    /// Baseline: globally smooth flow.
    HornSchunck(HornSchunckOptions),
}

impl Method {
    /// The method called `name` (see [`METHODS`]) with its default options.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `method` for another word.
    pub fn parse(name: &str) -> Result<Self> {
        MethodSettings { method: name.into(), ..MethodSettings::default() }.method()
    }

    /// The method's name, as [`Method::parse`] takes it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::CoarseToFine(_) => "coarse_to_fine",
            Self::Instantaneous(_) => "instantaneous",
            Self::Windowed(_) => "windowed",
            Self::LucasKanade(_) => "lucas_kanade",
            Self::HornSchunck(_) => "horn_schunck",
        }
    }

    /// The method's line in [`METHODS`].
    pub fn info(&self) -> &'static MethodInfo {
        let named = METHODS.iter().find(|method| method.name == self.name());
        named.unwrap_or(&METHODS[0])
    }

    /// The same estimate from two frames, where three give the step to the next frame; `None` for others.
    pub fn as_pair(&self) -> Option<Self> {
        match self {
            Self::CoarseToFine(options) if options.frames == 3 && !options.central => {
                Some(Self::CoarseToFine(CoarseToFineOptions { frames: 2, ..options.clone() }))
            }
            _ => None,
        }
    }

    /// The time over which the flow is taken.
    pub fn interval(&self) -> Interval {
        match self {
            Self::CoarseToFine(options) if options.frames == 3 && options.central => Interval::Central,
            Self::CoarseToFine(_) => Interval::Forward,
            _ => Interval::Instant,
        }
    }

    /// Standard deviation, px, of the weights that an estimate sums its data with: the distance over which
    /// errors of neighbouring estimates are correlated (see
    /// [`FieldLayout::correlation_length`](crate::types::FieldLayout)).
    pub fn correlation_length(&self) -> f64 {
        match self {
            Self::CoarseToFine(options) => correlation_length(options.frames),
            Self::Instantaneous(o) => o.neighbourhood.spread(),
            Self::Windowed(o) => {
                let smoothing = o.presmooth.unwrap_or(0.0);
                o.sigma.hypot(o.neighbourhood.spread()).hypot(smoothing)
            }
            Self::LucasKanade(o) => match o.window {
                Window::Gaussian(sigma) => sigma,
                Window::Box(side) => ((side * side - 1) as f64 / 12.0).sqrt(),
            },
            Self::HornSchunck(_) => 0.0,
        }
    }
}

/// A method with the options that a user gave, before any check. `None`: the method's default.
#[derive(Debug, Clone)]
pub struct MethodSettings {
    /// The name of the method.
    pub method: String,
    /// Cost against error: a name of [`Preset`].
    pub preset: Option<String>,
    /// Pyramid levels.
    pub levels: Option<usize>,
    /// A name of [`ModelKind`].
    pub model: Option<String>,
    /// How time derivatives are taken: one of [`MethodInfo::time_schemes`].
    pub time_scheme: Option<String>,
    /// Pixels that each jet is fitted to; its own weights hold unless `neighbourhood_sigma` is given.
    pub neighbourhood: Option<Neighbourhood>,
    /// Standard deviation of the Gaussian weights of the neighbourhood, px.
    pub neighbourhood_sigma: Option<f64>,
    /// Standard deviation of the window, px.
    pub window_sigma: Option<f64>,
    /// A name of [`RowSet`].
    pub rows: Option<String>,
    /// Weight of smoothness, in units of the frame's root mean square gradient.
    pub smoothness: Option<f64>,
    /// Maximum number of iterations.
    pub iterations: Option<usize>,
    /// A name of [`RankPolicy`].
    pub rank_deficient: Option<String>,
    /// Standard deviation of the Gaussian that smooths the frames, px; 0 for none. Taken by every method:
    /// ignored here unless [`MethodInfo::smooths_frames`], where the caller must not smooth.
    pub smooth: Option<f64>,
}

impl Default for MethodSettings {
    fn default() -> Self {
        Self {
            method: METHODS[0].name.into(),
            preset: None,
            levels: None,
            model: None,
            time_scheme: None,
            neighbourhood: None,
            neighbourhood_sigma: None,
            window_sigma: None,
            rows: None,
            smoothness: None,
            iterations: None,
            rank_deficient: None,
            smooth: None,
        }
    }
}

impl MethodSettings {
    /// The method with its options. Ranges of numbers are checked by [`Estimator::new`](super::Estimator).
    ///
    /// # Errors
    /// [`Error::Argument`] naming an unknown method, an option that the method does not take, or a word that
    /// the option does not know.
    pub fn method(&self) -> Result<Method> {
        let info = MethodInfo::named(&self.method)?;
        self.check_options(info)?;
        self.check_model(info)?;
        self.check_time_scheme(info)?;
        match info.name {
            "windowed" => self.windowed().map(Method::Windowed),
            "instantaneous" => self.instantaneous().map(Method::Instantaneous),
            "lucas_kanade" => self.lucas_kanade().map(Method::LucasKanade),
            "horn_schunck" => self.horn_schunck().map(Method::HornSchunck),
            _ => self.coarse_to_fine().map(Method::CoarseToFine),
        }
    }

    /// The options of single methods, and whether each was given. `model` is checked by its value.
    pub fn given(&self) -> [(&'static str, bool); 10] {
        [
            ("preset", self.preset.is_some()),
            ("levels", self.levels.is_some()),
            ("time_scheme", self.time_scheme.is_some()),
            ("neighbourhood", self.neighbourhood.is_some()),
            ("neighbourhood_sigma", self.neighbourhood_sigma.is_some()),
            ("window_sigma", self.window_sigma.is_some()),
            ("rows", self.rows.is_some()),
            ("smoothness", self.smoothness.is_some()),
            ("iterations", self.iterations.is_some()),
            ("rank_deficient", self.rank_deficient.is_some()),
        ]
    }

    fn check_options(&self, info: &MethodInfo) -> Result<()> {
        for (name, is_given) in self.given() {
            if is_given && !info.options.contains(&name) {
                let takers = METHODS.iter().filter(|method| method.options.contains(&name));
                let expected = format!("method {}", alternatives(takers.map(|method| method.name)));
                return Err(Error::argument(name, expected, info.name));
            }
        }
        Ok(())
    }

    fn check_model(&self, info: &MethodInfo) -> Result<()> {
        let Some(name) = self.model.as_deref() else { return Ok(()) };
        if info.models.contains(&ModelKind::parse(name)?) {
            return Ok(());
        }
        let known = alternatives(info.models.iter().map(|model| model.name()));
        Err(Error::argument("model", format!("{known} for method {}", info.name), name))
    }

    fn check_time_scheme(&self, info: &MethodInfo) -> Result<()> {
        let Some(name) = self.time_scheme.as_deref().filter(|name| !info.time_schemes.contains(name)) else {
            return Ok(());
        };
        let known = alternatives(info.time_schemes.iter().copied());
        Err(Error::argument("time_scheme", format!("{known} for method {}", info.name), name))
    }

    fn is_pair(&self) -> bool {
        self.time_scheme.as_deref() == Some(PAIR)
    }

    /// Three frames' time differences, where the method takes them from [`TimeScheme`].
    fn scheme(&self, default: TimeScheme) -> Result<TimeScheme> {
        self.time_scheme.as_deref().filter(|name| *name != PAIR).map_or(Ok(default), TimeScheme::parse)
    }

    fn differences(&self, default: Differences) -> Result<Differences> {
        self.time_scheme.as_deref().map_or(Ok(default), Differences::parse)
    }

    fn rank_policy(&self, default: RankPolicy) -> Result<RankPolicy> {
        self.rank_deficient.as_deref().map_or(Ok(default), RankPolicy::parse)
    }

    fn neighbourhood(&self, default: Neighbourhood) -> Neighbourhood {
        self.neighbourhood.clone().unwrap_or(default).weighted(self.neighbourhood_sigma)
    }

    fn coarse_to_fine(&self) -> Result<CoarseToFineOptions> {
        let mut options = CoarseToFineOptions { levels: self.levels, ..CoarseToFineOptions::default() };
        options.preset = self.preset.as_deref().map_or(Ok(options.preset), Preset::parse)?;
        if self.is_pair() {
            options.frames = 2;
        } else if let Some(name) = self.time_scheme.as_deref() {
            options.set_scheme(name)?;
        }
        Ok(options)
    }

    fn windowed(&self) -> Result<WindowedOptions> {
        let mut options = if self.is_pair() { WindowedOptions::pair() } else { WindowedOptions::default() };
        options.scheme = self.scheme(options.scheme)?;
        options.neighbourhood = self.neighbourhood(options.neighbourhood);
        options.sigma = self.window_sigma.unwrap_or(options.sigma);
        options.rows = self.rows.as_deref().map_or(Ok(options.rows), RowSet::parse)?;
        options.rank_deficient = self.rank_policy(options.rank_deficient)?;
        if let Some(sigma) = self.smooth {
            options.presmooth = Some(sigma).filter(|&sigma| sigma > 0.0);
        }
        Ok(options)
    }

    fn instantaneous(&self) -> Result<InstantaneousOptions> {
        let default = InstantaneousOptions::default();
        Ok(InstantaneousOptions {
            model: self.model.as_deref().map_or(Ok(default.model), ModelKind::parse)?,
            scheme: self.scheme(default.scheme)?,
            rank_deficient: self.rank_policy(default.rank_deficient)?,
            neighbourhood: self.neighbourhood(default.neighbourhood),
        })
    }

    fn lucas_kanade(&self) -> Result<LucasKanadeOptions> {
        let mut options = LucasKanadeOptions::default();
        options.window = self.window_sigma.map_or(options.window, Window::Gaussian);
        options.differences = self.differences(options.differences)?;
        Ok(options)
    }

    fn horn_schunck(&self) -> Result<HornSchunckOptions> {
        let mut options = HornSchunckOptions::default();
        options.smoothness = self.smoothness.map_or(options.smoothness, Smoothness::Relative);
        options.iterations = self.iterations.unwrap_or(options.iterations);
        options.differences = self.differences(options.differences)?;
        Ok(options)
    }
}

/// `a, b or c`.
fn alternatives<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.collect();
    match names.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
        _ => names.concat(),
    }
}
