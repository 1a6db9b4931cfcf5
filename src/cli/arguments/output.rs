//! Where results go.

use super::parse_positive;
use crate::pipeline::PictureRanges;
use clap::Args;
use std::path::PathBuf;

/// Output, formats and pictures.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Output")]
pub struct OutputArguments {
    /// A folder for numbered files (one per field: 000001.npz, ...), or one file (.npz .flo .png .pfm .csv)
    /// when exactly one field comes; a .csv takes any number of fields, and `-` is CSV on standard output.
    /// Needed, except with --points (then `-`), for the summary of --json alone, or where a filter's state is
    /// all that is saved. A new folder with a dot in its name needs a / at its end
    #[arg(long, short, value_name = "OUT")]
    pub output: Option<PathBuf>,
    /// Formats in a folder: npz (everything), flo, kitti (PNG), pfm, csv (a row a site: frame, time_s where
    /// it is known, x, y, status, parameters, their standard deviations) [default: npz]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub format: Vec<String>,
    /// Pictures (PNG): colour, quiver, divergence, curl
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub picture: Vec<String>,
    /// Speed of the full colour (and of the usual arrow) in pictures, px/frame [default: from the first
    /// field]
    #[arg(long, value_name = "SPEED", value_parser = parse_positive)]
    pub max_speed: Option<f64>,
    /// Divergence or curl of the full red and blue in pictures, 1/s where the frame rate is known, else
    /// 1/frame [default: from the first field]
    #[arg(long, value_name = "RATE", value_parser = parse_positive)]
    pub max_rate: Option<f64>,
    /// Replace files that exist; when the run is complete, what an earlier run left in the folder for further
    /// frames is removed, from the frame --start on
    #[arg(long)]
    pub force: bool,
}

impl OutputArguments {
    /// Ranges of the pictures.
    pub fn ranges(&self) -> PictureRanges {
        PictureRanges { speed: self.max_speed, rate: self.max_rate }
    }
}
