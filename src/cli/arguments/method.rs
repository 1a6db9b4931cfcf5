//! Which estimator, and its options.

use super::{UnitArguments, parse_not_negative, parse_positive, parse_size};
use crate::error::Result;
use crate::flow::{Method, MethodInfo, MethodSettings, PAIR};
use crate::jet::Neighbourhood;
use crate::temporal::RecursiveOptions;
use clap::Args;
use serde_json::{Value, json};
use std::path::PathBuf;

/// Estimator options, as [`MethodSettings`] has them.
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
    /// coarse-to-fine: flow from elsewhere to start from, .flo or .png (KITTI) of the frames' size, px/frame
    #[arg(long, value_name = "FILE")]
    pub initial: Option<PathBuf>,
    /// instantaneous: motion model, affine (default), translational or accelerating
    #[arg(long, value_name = "NAME")]
    pub model: Option<String>,
    /// Time differences: forward (coarse-to-fine, its default), central (default of the others), backward
    /// (windowed, instantaneous), or pair, of two frames (not instantaneous; the default where there are two)
    #[arg(long, value_name = "NAME")]
    pub time_scheme: Option<String>,
    /// windowed, instantaneous: pixels of the local quadratic fit [default: 3x3]
    #[arg(long, value_name = "KxL", visible_alias = "neighborhood", value_parser = parse_size)]
    pub neighbourhood: Option<(usize, usize)>,
    /// windowed, instantaneous: standard deviation of the Gaussian weights of these pixels, px [default:
    /// equal weights]
    #[arg(long, value_name = "SIGMA", value_parser = parse_positive)]
    pub neighbourhood_sigma: Option<f64>,
    /// windowed, lucas-kanade: standard deviation of the Gaussian window, px [default: 4]
    #[arg(long, value_name = "SIGMA", value_parser = parse_positive)]
    pub window_sigma: Option<f64>,
    /// windowed: equations used, brightness (1), gradient (3), jet (6) or all (12) [default: all, for a pair
    /// gradient]
    #[arg(long, value_name = "SET")]
    pub rows: Option<String>,
    /// horn-schunck: weight of smoothness, in units of the frame's root mean square gradient [default: 1]
    #[arg(long, value_name = "WEIGHT", value_parser = parse_positive)]
    pub smoothness: Option<f64>,
    /// horn-schunck: maximum number of iterations
    #[arg(long, value_name = "N", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..))]
    pub iterations: Option<usize>,
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
    /// The frames are pairs of a double-frame recording, 1 and 2, 3 and 4, ...: a field for each pair and
    /// none between them. Of two inputs (A/ B/, a.tif b.tif) the first has the first frames of the pairs, the
    /// second the second ones; more inputs (A/*.tif B/*.tif) are frames in the order given
    #[arg(long)]
    pub pairs: bool,
    /// Leave the covariance out: faster, smaller files
    #[arg(long)]
    pub no_covariance: bool,
    /// Standard deviation of the pixel noise, grey levels [default: from the frames]
    #[arg(long, value_name = "LEVELS", value_parser = parse_not_negative)]
    pub noise: Option<f64>,
    #[command(flatten)]
    pub units: UnitArguments,
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
    pub fn method(&self, frames: Option<usize>, smooth: Option<f64>) -> Result<Method> {
        let method = word(&self.method);
        let is_pair = (self.pairs || frames == Some(2)) && MethodInfo::named(&method)?.takes_pairs();
        let settings = MethodSettings {
            method,
            preset: self.preset.clone(),
            levels: self.levels,
            model: self.model.clone(),
            time_scheme: self.time_scheme.clone().or_else(|| is_pair.then(|| PAIR.into())),
            neighbourhood: self.neighbourhood.map(rectangle),
            neighbourhood_sigma: self.neighbourhood_sigma,
            window_sigma: self.window_sigma,
            rows: self.rows.clone(),
            smoothness: self.smoothness,
            iterations: self.iterations,
            rank_deficient: self.rank_deficient.as_deref().map(word),
            smooth,
        };
        settings.method()
    }

    /// Whether and how estimates are fused over time.
    pub fn recursive(&self) -> Result<Option<RecursiveOptions>> {
        RecursiveOptions::parse(self.temporal.as_deref(), self.forgetting)
    }

    /// How fields are made, for the metadata of files.
    pub fn describe(&self, method: &Method) -> Value {
        let recursive = self.recursive().ok().flatten();
        json!({
            "method": method.name(), "options": format!("{method:?}"), "noise": self.noise,
            "initial": self.initial,
            "forgetting": recursive.map(|options| options.forgetting),
        })
    }
}
