//! What lengths are measured in.

use super::parse_pair;
use crate::types::Units;
use clap::Args;

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
