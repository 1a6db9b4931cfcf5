//! Which estimator, and its options.

use super::{parse_not_negative, parse_pair, parse_positive, parse_size};
use clap::{Args, ValueEnum};

/// The estimators of single fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum MethodName {
    /// Least squares of the transported equations over a Gaussian window: the accurate one
    Windowed,
    /// Least squares per pixel, WO2010/098160 (34): locally quadratic, nearly noise-free images only
    Instantaneous,
    /// Baseline: brightness constancy in a window (Lucas and Kanade 1981)
    LucasKanade,
    /// Baseline: global smoothness (Horn and Schunck 1981)
    HornSchunck,
}

/// What becomes of a pixel whose equations do not determine every unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum RankWord {
    /// NaN and a status that says why
    Nan,
    /// The solution of minimum norm, marked as such
    MinNorm,
}

/// How time derivatives are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SchemeWord {
    /// Around the middle one of three frames
    Central,
    /// From the latest of three frames backwards (the patent)
    Backward,
}

/// Estimator options.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Method")]
pub struct MethodArguments {
    /// Estimator
    #[arg(long, value_enum, value_name = "NAME", default_value = "windowed")]
    pub method: MethodName,
    /// Motion model of the instantaneous method: affine, translational or accelerating [default: affine]
    #[arg(long, value_name = "NAME")]
    pub model: Option<String>,
    /// Time differences [default: central]
    #[arg(long, value_enum, value_name = "NAME")]
    pub scheme: Option<SchemeWord>,
    /// Pixels of the local quadratic fit, at least 3x3 [default: 3x3]
    #[arg(long, value_name = "KxL", visible_alias = "neighborhood", value_parser = parse_size)]
    pub neighbourhood: Option<(usize, usize)>,
    /// Standard deviation of the window (windowed, lucas-kanade), px
    #[arg(long, value_name = "SIGMA", value_parser = parse_positive)]
    pub window: Option<f64>,
    /// Equations of the windowed method
    #[arg(long, value_name = "SET")]
    pub rows: Option<String>,
    /// Smoothness weight of horn-schunck
    #[arg(long, value_name = "WEIGHT", value_parser = parse_positive)]
    pub smoothness: Option<f64>,
    /// Iterations of horn-schunck, at most
    #[arg(long, value_name = "N")]
    pub iterations: Option<usize>,
    /// Pixels whose equations do not determine every unknown
    #[arg(long, value_enum, value_name = "POLICY")]
    pub rank_deficient: Option<RankWord>,
    /// Leave the covariance out (faster, smaller files)
    #[arg(long)]
    pub no_covariance: bool,
    /// Standard deviation of the pixel noise in grey levels [default: from the residual]
    #[arg(long, value_name = "LEVELS", value_parser = parse_not_negative)]
    pub noise: Option<f64>,
    /// Physical size of a pixel, DX or DX,DY; flow then comes in that unit per frame
    #[arg(long, value_name = "DX,DY", value_parser = parse_pair)]
    pub pixel_pitch: Option<(f64, f64)>,
}
