//! Where results go.

use clap::Args;
use std::path::PathBuf;

/// Output, formats and pictures.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Output")]
pub struct OutputArguments {
    /// A folder for numbered files (one per field: 000001.npz, ...), or one file (.npz .flo .png .pfm .csv) when exactly one field
    /// comes; a .csv takes any number of fields, and `-` is CSV on standard output
    #[arg(long, short, value_name = "OUT")]
    pub output: Option<PathBuf>,
    /// Formats in a folder: npz (everything), flo, kitti (PNG), pfm, csv [default: npz]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub format: Vec<String>,
    /// Pictures (PNG): colour, quiver, divergence, curl
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub picture: Vec<String>,
    /// Replace files that exist
    #[arg(long)]
    pub force: bool,
}
