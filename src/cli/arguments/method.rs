//! Which estimator, and its options.

use super::{parse_not_negative, parse_pair, parse_positive, parse_size};
use crate::error::{Error, Result};
use crate::flow::baseline::{Differences, HornSchunckOptions, LucasKanadeOptions, Smoothness, Window};
use crate::flow::coarse_to_fine::{CoarseToFineOptions, Preset};
use crate::flow::instantaneous::InstantaneousOptions;
use crate::flow::model::ModelKind;
use crate::flow::windowed::{RowSet, WindowedOptions};
use crate::flow::{Method, RankPolicy};
use crate::jet::{Neighbourhood, TimeScheme};
use crate::temporal::RecursiveOptions;
use clap::Args;
use serde_json::{Value, json};

/// Estimator options. Those that are not given keep the estimator's own default; those that the estimator
/// does not know are refused.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Method")]
pub struct MethodArguments {
    /// Estimator: coarse-to-fine (large motions, edges, untextured areas), windowed (one window, motions of a
    /// pixel or two), instantaneous (per pixel, for locally quadratic, nearly noise-free images), or the
    /// baselines lucas-kanade and horn-schunck
    #[arg(long, value_name = "NAME", default_value = "coarse-to-fine")]
    pub method: String,
    /// coarse-to-fine: cost against error, fast, balanced (default) or accurate
    #[arg(long, value_name = "NAME")]
    pub preset: Option<String>,
    /// coarse-to-fine: pyramid levels [default: as many as the frame allows]
    #[arg(long, value_name = "N")]
    pub levels: Option<usize>,
    /// instantaneous: motion model, affine (default), translational or accelerating
    #[arg(long, value_name = "NAME")]
    pub model: Option<String>,
    /// Time differences: forward (coarse-to-fine, its default), central (default of the others) or backward
    /// (windowed, instantaneous)
    #[arg(long, value_name = "NAME")]
    pub scheme: Option<String>,
    /// windowed, baselines: estimate from two frames instead of three (also chosen when there are just two)
    #[arg(long)]
    pub pair: bool,
    /// windowed, instantaneous: pixels of the local quadratic fit [default: 3x3]
    #[arg(long, value_name = "KxL", visible_alias = "neighborhood", value_parser = parse_size)]
    pub neighbourhood: Option<(usize, usize)>,
    /// windowed, lucas-kanade: standard deviation of the Gaussian window, px [default: 4]
    #[arg(long, value_name = "SIGMA", value_parser = parse_positive)]
    pub window: Option<f64>,
    /// windowed: equations used, brightness (1), gradient (3), jet (6) or all (12) [default: all, for a pair
    /// gradient]
    #[arg(long, value_name = "SET")]
    pub rows: Option<String>,
    /// horn-schunck: weight of smoothness, in units of the frame's root mean square gradient [default: 1]
    #[arg(long, value_name = "WEIGHT", value_parser = parse_positive)]
    pub smoothness: Option<f64>,
    /// windowed, instantaneous: what becomes of pixels whose equations do not determine every unknown, nan
    /// (default) or min-norm
    #[arg(long, value_name = "POLICY")]
    pub rank_deficient: Option<String>,
    /// recursive: fuse the estimates of all frames so far, for motion that is steady in the picture
    /// (windowed, coarse-to-fine, instantaneous); none (default): each frame by itself
    #[arg(long, value_name = "WHAT")]
    pub temporal: Option<String>,
    /// recursive: by what the information of the past is multiplied each frame, above 0 and at most 1; the
    /// memory is 1/(1 - F) frames [default: 0.95]
    #[arg(long, value_name = "F")]
    pub forgetting: Option<f64>,
    /// Leave the covariance out: faster, smaller files
    #[arg(long)]
    pub no_covariance: bool,
    /// Standard deviation of the pixel noise, grey levels [default: from the frames]
    #[arg(long, value_name = "LEVELS", value_parser = parse_not_negative)]
    pub noise: Option<f64>,
    /// Physical size of a pixel; flow then comes in that unit per frame
    #[arg(long, value_name = "DX[,DY]", value_parser = parse_pair)]
    pub pixel_pitch: Option<(f64, f64)>,
}

/// `lucas-kanade` and `lucas_kanade` are the same word.
pub fn word(text: &str) -> String {
    text.replace('-', "_")
}

/// A rectangle of equally weighted pixels.
pub fn rectangle((width, height): (usize, usize)) -> Neighbourhood {
    Neighbourhood::Rectangle { width, height, sigma: None }
}

impl MethodArguments {
    /// The method with its options, for a sequence of `frames` frames (if known) that are to be smoothed by
    /// `smooth` px.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the option that is unusable, or that this method does not know.
    pub fn method(&self, frames: Option<usize>, smooth: Option<f64>) -> Result<Method> {
        let method = Method::parse(&word(&self.method))?;
        self.refuse_foreign(&method)?;
        let pair = self.pair || frames == Some(2);
        Ok(match method {
            Method::CoarseToFine(mut options) => {
                options.preset = self.preset.as_deref().map_or(Ok(options.preset), Preset::parse)?;
                options.frames = if pair { 2 } else { options.frames };
                self.scheme.as_deref().map_or(Ok(()), |name| options.set_scheme(name))?;
                Method::CoarseToFine(CoarseToFineOptions { levels: self.levels, ..options })
            }
            Method::Windowed(_) => Method::Windowed(self.windowed(pair, smooth)?),
            Method::Instantaneous(options) => Method::Instantaneous(self.instantaneous(options)?),
            Method::LucasKanade(mut options) => {
                options.window = self.window.map_or(options.window, Window::Gaussian);
                Method::LucasKanade(LucasKanadeOptions { differences: differences(pair), ..options })
            }
            Method::HornSchunck(mut options) => {
                options.smoothness = self.smoothness.map_or(options.smoothness, Smoothness::Relative);
                Method::HornSchunck(HornSchunckOptions { differences: differences(pair), ..options })
            }
        })
    }

    fn windowed(&self, pair: bool, smooth: Option<f64>) -> Result<WindowedOptions> {
        let mut options = if pair { WindowedOptions::pair() } else { WindowedOptions::default() };
        options.sigma = self.window.unwrap_or(options.sigma);
        options.scheme = self.scheme(options.scheme)?;
        options.rows = self.rows.as_deref().map_or(Ok(options.rows), RowSet::parse)?;
        options.neighbourhood = self.neighbourhood.map_or(options.neighbourhood, rectangle);
        options.rank_deficient = self.rank_policy(options.rank_deficient)?;
        if smooth.is_some() {
            options.presmooth = smooth.filter(|&sigma| sigma > 0.0);
        }
        Ok(options)
    }

    fn instantaneous(&self, mut options: InstantaneousOptions) -> Result<InstantaneousOptions> {
        options.model = self.model.as_deref().map_or(Ok(options.model), ModelKind::parse)?;
        options.scheme = self.scheme(options.scheme)?;
        options.neighbourhood = self.neighbourhood.map_or(options.neighbourhood, rectangle);
        options.rank_deficient = self.rank_policy(options.rank_deficient)?;
        Ok(options)
    }

    fn rank_policy(&self, default: RankPolicy) -> Result<RankPolicy> {
        self.rank_deficient.as_deref().map_or(Ok(default), |name| RankPolicy::parse(&word(name)))
    }

    fn scheme(&self, default: TimeScheme) -> Result<TimeScheme> {
        self.scheme.as_deref().map_or(Ok(default), TimeScheme::parse)
    }

    /// Whether and how estimates are fused over time.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `temporal` or `forgetting`.
    pub fn recursive(&self) -> Result<Option<RecursiveOptions>> {
        RecursiveOptions::parse(self.temporal.as_deref(), self.forgetting)
    }

    /// An option that would silently do nothing is a mistake.
    fn refuse_foreign(&self, method: &Method) -> Result<()> {
        let (windowed, instantaneous) =
            (matches!(method, Method::Windowed(_)), matches!(method, Method::Instantaneous(_)));
        let lucas_kanade = matches!(method, Method::LucasKanade(_));
        let coarse_to_fine = matches!(method, Method::CoarseToFine(_));
        let given: [(&'static str, bool, bool); 10] = [
            ("preset", self.preset.is_some(), coarse_to_fine),
            ("levels", self.levels.is_some(), coarse_to_fine),
            ("model", self.model.is_some(), instantaneous),
            ("scheme", self.scheme.is_some(), coarse_to_fine || windowed || instantaneous),
            ("pair", self.pair, !instantaneous),
            ("neighbourhood", self.neighbourhood.is_some(), windowed || instantaneous),
            ("window", self.window.is_some(), windowed || lucas_kanade),
            ("rows", self.rows.is_some(), windowed),
            ("smoothness", self.smoothness.is_some(), matches!(method, Method::HornSchunck(_))),
            ("rank_deficient", self.rank_deficient.is_some(), windowed || instantaneous),
        ];
        match given.iter().find(|(_, given, known)| *given && !known) {
            Some((name, ..)) => Err(Error::argument(name, "a method that has this option", method.name())),
            None => Ok(()),
        }
    }

    /// How fields are made, for the metadata of files.
    pub fn describe(&self, method: &Method) -> Value {
        let recursive = self.recursive().ok().flatten();
        json!({
            "method": method.name(), "options": format!("{method:?}"), "noise": self.noise,
            "forgetting": recursive.map(|options| options.forgetting),
        })
    }
}

fn differences(pair: bool) -> Differences {
    if pair { Differences::Pair } else { Differences::Central }
}
