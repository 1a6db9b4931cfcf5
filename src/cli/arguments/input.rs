//! Where frames come from, what is done to them first, and the size of their pixels.

use super::{parse_not_negative, parse_pair, parse_positive, parse_rate};
use crate::error::{Error, Result};
use crate::io::{Colour, OpenOptions, PlaneSelection, Slices};
use crate::pipeline::Numbering;
use crate::types::Units;
use clap::Args;

/// Which planes of TIFF files with several axes are frames.
#[derive(Debug, Clone, Copy, Args)]
pub struct PlaneArguments {
    /// Channel of TIFF files that hold several (ImageJ, OME-TIFF), from 0
    #[arg(long, value_name = "N")]
    pub channel: Option<usize>,
    /// Slice (axis Z) of TIFF files that hold several, from 0; time: the slices are frames
    #[arg(long, value_name = "N", value_parser = parse_slices)]
    pub z: Option<Slices>,
}

impl PlaneArguments {
    /// The selection of planes.
    pub fn selection(self) -> PlaneSelection {
        PlaneSelection { channel: self.channel, z: self.z }
    }
}

fn parse_slices(text: &str) -> std::result::Result<Slices, String> {
    match text.parse() {
        Ok(index) => Ok(Slices::Index(index)),
        Err(_) if text == "time" => Ok(Slices::AsTime),
        Err(_) => Err("expected an index from 0, or time".into()),
    }
}

/// Which frames of the input are used, and colour.
#[derive(Debug, Clone, Args)]
pub struct SelectionArguments {
    /// Convert colour to luminance (0.299 R + 0.587 G + 0.114 B); without it colour is refused
    #[arg(long)]
    pub luminance: bool,
    #[command(flatten)]
    pub planes: PlaneArguments,
    /// Index of the first frame to use
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub start: usize,
    /// Index after the last frame to use [default: all frames]
    #[arg(long, value_name = "N")]
    pub stop: Option<usize>,
    /// Use every N-th frame
    #[arg(long, value_name = "N", default_value = "1", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..))]
    pub step: usize,
}

impl SelectionArguments {
    /// How sources are opened.
    pub fn options(&self) -> OpenOptions {
        OpenOptions {
            colour: if self.luminance { Colour::Luminance } else { Colour::Error },
            planes: self.planes.selection(),
            start: self.start,
            stop: self.stop,
            step: self.step,
            ..OpenOptions::default()
        }
    }

    /// Refuses a range of frames that holds fewer than `min` of `what`.
    pub fn check_count(&self, min: usize, what: &str) -> Result<()> {
        match self.stop.map(|stop| stop.saturating_sub(self.start).div_ceil(self.step)) {
            Some(count) if count < min => Err(Error::argument("stop", format!("at least {min} {what}"), count)),
            _ => Ok(()),
        }
    }

    /// Which frames of the input these are; `given` or else `delivered` by the source: frames per second.
    pub fn numbering(&self, given: Option<f64>, delivered: Option<f64>) -> Numbering {
        let rate = given.or_else(|| delivered.map(|rate| rate * self.step as f64));
        Numbering { start: self.start, step: self.step, rate, has_own_times: given.is_none() }
    }
}

/// Frames and their preparation.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Input")]
pub struct InputArguments {
    /// Frames: a folder (natural order), a pattern ('frames/*.png'), several images, a .y4m or .npy file, `-`
    /// (Y4M on standard input), or a video file (needs ffmpeg on the PATH)
    #[arg(required = true, value_name = "INPUT")]
    pub input: Vec<String>,
    #[command(flatten)]
    pub selection: SelectionArguments,
    /// Frames per second of the input (a number or a fraction) [default: what the file says]
    #[arg(long, value_name = "RATE", value_parser = parse_rate)]
    pub fps: Option<f64>,
    /// Round samples down to multiples of STEP before anything else
    #[arg(long, value_name = "STEP", num_args = 0..=1, require_equals = true, default_missing_value = "1", visible_alias = "quantize", value_parser = parse_positive)]
    pub quantise: Option<f64>,
    /// Smooth each frame by a Gaussian of SIGMA pixels [default: windowed 1.5, everything else 0]
    #[arg(long, value_name = "SIGMA", value_parser = parse_not_negative)]
    pub smooth: Option<f64>,
}

/// Physical size of a pixel. The unit of time follows from the frame rate of the input.
#[derive(Debug, Clone, Args)]
pub struct UnitArguments {
    /// Physical size of a pixel; lengths then come in that unit [default: what a TIFF file of ImageJ or OME
    /// says, else px]
    #[arg(long, value_name = "DX[,DY]", value_parser = parse_pair)]
    pub pixel_pitch: Option<(f64, f64)>,
    /// Name of that unit, such as mm
    #[arg(long, value_name = "NAME", requires = "pixel_pitch")]
    pub length_unit: Option<String>,
}

impl UnitArguments {
    /// The units of a field, with the seconds between frames if they are known.
    pub fn units(&self, frame_period: Option<f64>) -> Units {
        Units::new(self.pixel_pitch.unwrap_or((1.0, 1.0)), self.length_unit.as_deref(), frame_period)
    }
}
