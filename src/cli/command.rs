//! The subcommands.

use super::demo::DemoCommand;
use super::egomotion::EgomotionCommand;
use super::filter::FilterCommand;
use super::flow::FlowCommand;
use super::info::InfoCommand;
use super::interrupt::Watch;
use super::measure::MeasureCommand;
use super::report::Report;
use super::stereo::StereoCommand;
use super::synth::SynthCommand;
use super::track::TrackCommand;
use crate::error::Result;
use clap::Subcommand;

/// What the program can do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Estimate flow and its Jacobian from frames
    Flow(Box<FlowCommand>),
    /// Filter flow and its Jacobian over time
    Filter(Box<FilterCommand>),
    /// Measure rotation, time to contact, divergence, ... with their standard deviations
    Measure(Box<MeasureCommand>),
    /// Follow moving targets: position, velocity, box, scale and rotation, with their covariance
    Track(Box<TrackCommand>),
    /// Disparity of the edge pixels of two views
    Stereo(Box<StereoCommand>),
    /// The camera's rigid motion from frame to frame, focus of expansion and time to contact
    Egomotion(Box<EgomotionCommand>),
    /// Write a moving scene whose flow and Jacobian are known exactly
    Synth(Box<SynthCommand>),
    /// Describe a recording or a result file
    Info(InfoCommand),
    /// Make a scene, estimate its flow, draw it and compare with the truth
    Demo(DemoCommand),
}

impl Command {
    /// Whether standard output is for one JSON object.
    pub fn json(&self) -> bool {
        match self {
            Self::Flow(command) => command.messages.json,
            Self::Filter(command) => command.messages.json,
            Self::Measure(command) => command.messages.json,
            Self::Track(command) => command.messages.json,
            Self::Stereo(command) => command.messages.json,
            Self::Egomotion(command) => command.messages.json,
            Self::Synth(command) => command.messages.json,
            Self::Info(command) => command.messages.json,
            Self::Demo(command) => command.messages.json,
        }
    }

    /// Does it.
    pub fn execute(&self, watch: &Watch) -> Result<Report> {
        match self {
            Self::Flow(command) => command.execute(watch),
            Self::Filter(command) => command.execute(watch),
            Self::Measure(command) => command.execute(watch),
            Self::Track(command) => command.execute(watch),
            Self::Stereo(command) => command.execute(watch),
            Self::Egomotion(command) => command.execute(watch),
            Self::Synth(command) => command.execute(watch),
            Self::Info(command) => command.execute(watch),
            Self::Demo(command) => command.execute(watch),
        }
    }
}
