//! How the work is done and what is told about it.

use clap::{Args, ValueEnum};

/// The precision of the computation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Precision {
    /// Single for 8-bit, 16-bit and single-precision frames, double for double-precision frames and for
    /// filters whose measurement noise is below 0.25
    Auto,
    /// 32-bit floating point
    Single,
    /// 64-bit floating point
    Double,
}

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
    /// Precision of the computation
    #[arg(long, value_enum, value_name = "WHICH", default_value = "auto")]
    pub precision: Precision,
}

/// What is told on the terminal.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Messages")]
pub struct TellArguments {
    /// Print exactly one JSON object, the summary, on standard output
    #[arg(long)]
    pub json: bool,
    /// No progress and no summary on standard error; errors only
    #[arg(long, short)]
    pub quiet: bool,
}
