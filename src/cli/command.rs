//! The subcommands.

use super::flow::FlowCommand;
use super::interrupt::Watch;
use super::report::Report;
use super::synth::SynthCommand;
use crate::error::Result;
use clap::Subcommand;

/// What the program can do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Estimate flow and its Jacobian from frames
    Flow(Box<FlowCommand>),
    /// Write a moving scene whose flow and Jacobian are known exactly
    Synth(SynthCommand),
}

impl Command {
    /// Whether standard output is for one JSON object.
    pub fn json(&self) -> bool {
        match self {
            Self::Flow(command) => command.tell.json,
            Self::Synth(command) => command.tell.json,
        }
    }

    /// Does it.
    pub fn execute(&self, watch: &Watch) -> Result<Report> {
        match self {
            Self::Flow(command) => command.execute(watch),
            Self::Synth(command) => command.execute(watch),
        }
    }
}
