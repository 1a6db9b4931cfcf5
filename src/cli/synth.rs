//! `jacoflow synth`: recordings of scenes with known motion.

use super::arguments::TellArguments;
use super::interrupt::Watch;
use super::report::{Report, print};
use crate::error::Result;
use clap::Args;

/// Options of `synth`.
#[derive(Debug, Args)]
pub struct SynthCommand {
    /// List the scenes
    #[arg(long)]
    pub list: bool,
    #[command(flatten)]
    pub tell: TellArguments,
}

impl SynthCommand {
    /// Runs the command.
    pub fn execute(&self, watch: &Watch) -> Result<Report> {
        watch.check()?;
        if self.list {
            print("ramp\n")?;
        }
        Ok(Report::default())
    }
}
