//! Threads, instruction set, precision, and messages.

use crate::types::Precision;
use clap::Args;

/// Threads.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Computation")]
pub struct ThreadArguments {
    /// Number of threads; the result does not depend on it [default: JACOFLOW_THREADS, else every processor]
    #[arg(long, value_name = "N", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..))]
    pub threads: Option<usize>,
}

/// Threads, instruction set, precision.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Computation")]
pub struct ComputeArguments {
    #[command(flatten)]
    pub threads: ThreadArguments,
    /// Instruction set: scalar, avx2 or avx512 [default: JACOFLOW_SIMD, else the best of this processor]
    #[arg(long, value_name = "LEVEL")]
    pub simd: Option<String>,
    /// Precision of the computation: float32, float64, or auto (float32 for 8-bit, 16-bit and float32 frames,
    /// float64 for float64 frames and for filters whose measurement noise is below 0.25)
    #[arg(long, value_name = "WHICH", default_value = "auto", value_parser = parse_precision)]
    pub precision: Precision,
}

fn parse_precision(text: &str) -> Result<Precision, String> {
    Precision::parse(text).map_err(|error| error.to_string())
}

/// Messages on the terminal.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Messages")]
pub struct MessageArguments {
    /// Print exactly one JSON object, the summary, on standard output
    #[arg(long)]
    pub json: bool,
    /// No progress and no summary on standard error; errors only
    #[arg(long, short)]
    pub quiet: bool,
}
