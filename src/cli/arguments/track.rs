//! What is followed, and how.

use crate::error::{Error, Result};
use crate::track::METHODS;
use crate::track::gradient::{CameraMotion, GradientOptions, Shape, Start};
use crate::track::particle::ParticleMode;
use crate::track::stereo::StereoMode;
use crate::types::TargetBox;
use clap::{Args, ValueEnum};

/// Targets in the first frame.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Targets")]
pub struct TargetArguments {
    /// A target's box in the first frame, px: left and upper side, width, height, where pixel k reaches from
    /// k - 1/2 to k + 1/2; may be repeated
    #[arg(long = "bbox", value_name = "X,Y,WIDTH,HEIGHT", value_parser = parse_box, allow_hyphen_values = true)]
    pub boxes: Vec<TargetBox>,
    /// A point on a target in the first frame, px: what moves nearest to it is followed; may be repeated.
    /// Targets are numbered from 1, boxes first
    #[arg(long = "center", value_name = "X,Y", value_parser = parse_point, allow_hyphen_values = true)]
    pub points: Vec<[f64; 2]>,
}

impl TargetArguments {
    /// Whether any was given.
    pub fn given(&self) -> Option<&'static str> {
        self.boxes.first().map(|_| "bbox").or(self.points.first().map(|_| "center"))
    }

    /// What is known of each target; without any, the one that moves first.
    pub fn starts(&self) -> Vec<Start> {
        let boxes = self.boxes.iter().map(|bounds| Start::Box(*bounds));
        let starts: Vec<Start> = boxes.chain(self.points.iter().map(|point| Start::Centre(*point))).collect();
        if starts.is_empty() { vec![Start::Motion] } else { starts }
    }
}

/// Options of the tracker. Those that are not given keep the tracker's own default.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Method")]
pub struct TrackerArguments {
    /// Tracker: gradient (given targets in one view), particle (given targets that may look alike and cross,
    /// in colour) or stereo (everything that moves before two cameras)
    #[arg(long, value_name = "NAME", default_value = "gradient")]
    pub method: String,
    /// Variant of stereo and particle [default: improved]
    #[arg(long, value_enum, value_name = "NAME")]
    pub mode: Option<ModeWord>,
    /// Seed of the random numbers (stereo, particle) [default: 0]
    #[arg(long, value_name = "N")]
    pub random_state: Option<u64>,
    /// How the target's picture deforms (gradient) [default: similarity]
    #[arg(long, value_enum, value_name = "NAME")]
    pub model: Option<ModelWord>,
    /// What the camera does (gradient) [default: auto]
    #[arg(long, value_enum, value_name = "WHAT")]
    pub camera: Option<CameraWord>,
}

/// Variant of a tracker.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ModeWord {
    /// Stereo: motion to fractions of a pixel carries the clusters along; particle: corner tracks must move
    /// with their target
    Improved,
    /// The paper's text to the letter, for comparison
    Paper,
}

/// What the target's picture does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ModelWord {
    /// It turns and grows
    Similarity,
    /// It is stretched in any direction too
    Affine,
}

/// What the camera does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum CameraWord {
    /// It may move
    Auto,
    /// It stands still
    None,
}

impl TrackerArguments {
    /// The method's name, one that is known.
    pub fn method(&self) -> Result<&'static str> {
        let known = METHODS.iter().copied().find(|name| *name == self.method);
        known.ok_or_else(|| Error::argument("method", format!("one of {}", METHODS.join(", ")), &self.method))
    }

    /// Whether an option of the gradient tracker alone was given.
    pub fn given(&self) -> Option<&'static str> {
        self.model.map(|_| "model").or(self.camera.map(|_| "camera"))
    }

    /// The options of the gradient tracker.
    pub fn gradient(&self) -> Result<GradientOptions> {
        if self.mode.is_some() {
            return Err(Error::argument("mode", "no mode, which is for stereo and particle", "a mode with gradient"));
        }
        let defaults = GradientOptions::default();
        Ok(GradientOptions {
            shape: match self.model {
                None => defaults.shape,
                Some(ModelWord::Similarity) => Shape::Similarity,
                Some(ModelWord::Affine) => Shape::Affine,
            },
            camera: match self.camera {
                None => defaults.camera,
                Some(CameraWord::Auto) => CameraMotion::Auto,
                Some(CameraWord::None) => CameraMotion::None,
            },
        })
    }

    /// The mode of the stereo tracker.
    pub fn stereo_mode(&self) -> StereoMode {
        match self.mode {
            None | Some(ModeWord::Improved) => StereoMode::Improved,
            Some(ModeWord::Paper) => StereoMode::Paper,
        }
    }

    /// The mode of the particle tracker.
    pub fn particle_mode(&self) -> ParticleMode {
        match self.mode {
            None | Some(ModeWord::Improved) => ParticleMode::Improved,
            Some(ModeWord::Paper) => ParticleMode::Paper,
        }
    }
}

/// N finite numbers with commas between.
pub(super) fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let values: Vec<f64> = text.split(',').map(|word| word.trim().parse().ok()).collect::<Option<_>>()?;
    <[f64; N]>::try_from(values).ok().filter(|values| values.iter().all(|value| value.is_finite()))
}

fn parse_box(text: &str) -> std::result::Result<TargetBox, String> {
    match numbers(text) {
        Some([x, y, width, height]) if width > 0.0 && height > 0.0 => Ok(TargetBox { x, y, width, height }),
        _ => Err("expected X,Y,WIDTH,HEIGHT in pixels with a positive width and height".into()),
    }
}

fn parse_point(text: &str) -> std::result::Result<[f64; 2], String> {
    numbers(text).ok_or_else(|| "expected two numbers X,Y in pixels".into())
}
