//! The subcommands.

use super::interrupt::Watch;
use super::report::Report;
use super::synth::SynthCommand;
use crate::error::Result;
use clap::Subcommand;

/// What the program can do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Write a moving scene whose flow and Jacobian are known exactly
    Synth(SynthCommand),
}

impl Command {
    /// Whether standard output is for one JSON object.
    pub fn json(&self) -> bool {
        match self {
            Self::Synth(command) => command.tell.json,
        }
    }

    /// Does it.
    pub fn execute(&self, watch: &Watch) -> Result<Report> {
        match self {
            Self::Synth(command) => command.execute(watch),
        }
    }
}
