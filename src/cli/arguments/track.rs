//! What is followed, and how.

use crate::error::{Error, Result};
use crate::track::METHODS;
use crate::track::gradient::{CameraMotion, Control, GradientOptions, Mode, Shape, Start};
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
    #[arg(long = "box", value_name = "X,Y,WIDTH,HEIGHT", value_parser = parse_box, allow_hyphen_values = true)]
    pub boxes: Vec<TargetBox>,
    /// A point on a target in the first frame, px: what moves nearest to it is followed; may be repeated.
    /// Targets are numbered from 1, boxes first
    #[arg(long = "point", value_name = "X,Y", value_parser = parse_point, allow_hyphen_values = true)]
    pub points: Vec<[f64; 2]>,
}

impl TargetArguments {
    /// Whether any was given.
    pub fn given(&self) -> Option<&'static str> {
        self.boxes.first().map(|_| "box").or(self.points.first().map(|_| "point"))
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
    /// Which system follows the targets [default: layered, stereo and particle improved]
    #[arg(long, value_enum, value_name = "NAME")]
    pub mode: Option<ModeWord>,
    /// Seed of the random numbers (stereo, particle) [default: 0]
    #[arg(long, value_name = "N")]
    pub random_state: Option<u64>,
    /// Side of the window that is looked at, px (local, paper), made odd [default: 51, or 1.6 times the box]
    #[arg(long, value_name = "PX")]
    pub fov: Option<usize>,
    /// How the window follows the target (local) [default: integer]
    #[arg(long, value_enum, value_name = "HOW")]
    pub control: Option<ControlWord>,
    /// What the target's picture does besides moving (layered) [default: similarity]
    #[arg(long, value_enum, value_name = "NAME")]
    pub model: Option<ModelWord>,
    /// What the camera does (layered) [default: auto]
    #[arg(long, value_enum, value_name = "WHAT")]
    pub camera: Option<CameraWord>,
    /// Degree of the polynomials behind the derivatives, 1 to 4 [default: 4, paper 2]
    #[arg(long, value_name = "N")]
    pub order: Option<usize>,
    /// Side of the windows of local flow, 3, 5 or 7 px [default: 7, paper 5]
    #[arg(long, value_name = "PX")]
    pub window: Option<usize>,
    /// Slowest flow that counts as motion, px/frame, or auto: from the flow outside the target [default: 0.5]
    #[arg(long, value_name = "SPEED|auto", value_parser = parse_eps, allow_hyphen_values = true)]
    pub eps: Option<Eps>,
}

/// Which system follows the target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ModeWord {
    /// Target and background as layers; the most accurate
    Layered,
    /// Local flow in a moving window, with the repairs that it needs; the fastest
    Local,
    /// Stereo: motion to fractions of a pixel carries the clusters along; particle: corner tracks must move
    /// with their target
    Improved,
    /// The paper's text to the letter, for comparison
    Paper,
}

/// How the window follows the target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ControlWord {
    /// In whole pixels
    Integer,
    /// To fractions of a pixel
    Subpixel,
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

/// The slowest flow that counts as motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Eps {
    /// Measured.
    Auto,
    /// In px/frame.
    Speed(f64),
}

impl TrackerArguments {
    /// The method's name, one that is known.
    ///
    /// # Errors
    /// [`Error::Argument`] named `method`.
    pub fn method(&self) -> Result<&'static str> {
        let known = METHODS.iter().copied().find(|name| *name == self.method);
        known.ok_or_else(|| Error::argument("method", format!("one of {}", METHODS.join(", ")), &self.method))
    }

    /// Whether an option of the gradient tracker alone was given.
    pub fn given(&self) -> Option<&'static str> {
        [
            self.fov.map(|_| "fov"),
            self.control.map(|_| "control"),
            self.model.map(|_| "model"),
            self.camera.map(|_| "camera"),
            self.order.map(|_| "order"),
            self.window.map(|_| "window"),
            self.eps.map(|_| "eps"),
        ]
        .into_iter()
        .find_map(|given| given)
    }

    /// The options of the gradient tracker.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the option.
    pub fn gradient(&self) -> Result<GradientOptions> {
        let defaults = GradientOptions::default();
        let options = GradientOptions {
            mode: match self.mode {
                None => defaults.mode,
                Some(ModeWord::Layered) => Mode::Layered,
                Some(ModeWord::Local) => Mode::Local,
                Some(ModeWord::Paper) => Mode::Paper,
                Some(ModeWord::Improved) => {
                    return Err(Error::argument("mode", "layered, local or paper for gradient", "improved"));
                }
            },
            fov: self.fov,
            control: match self.control {
                None => defaults.control,
                Some(ControlWord::Integer) => Control::Integer,
                Some(ControlWord::Subpixel) => Control::Subpixel,
            },
            window: self.window,
            order: self.order,
            eps: match self.eps {
                None => defaults.eps,
                Some(Eps::Auto) => None,
                Some(Eps::Speed(speed)) => Some(speed),
            },
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
        };
        options.check()?;
        Ok(options)
    }

    /// The mode of the stereo tracker.
    ///
    /// # Errors
    /// [`Error::Argument`] named `mode`.
    pub fn stereo_mode(&self) -> Result<StereoMode> {
        match self.mode {
            None | Some(ModeWord::Improved) => Ok(StereoMode::Improved),
            Some(ModeWord::Paper) => Ok(StereoMode::Paper),
            Some(ModeWord::Layered | ModeWord::Local) => {
                Err(Error::argument("mode", "improved or paper for stereo", "a mode of gradient"))
            }
        }
    }

    /// The mode of the particle tracker.
    ///
    /// # Errors
    /// [`Error::Argument`] named `mode`.
    pub fn particle_mode(&self) -> Result<ParticleMode> {
        match self.mode {
            None | Some(ModeWord::Improved) => Ok(ParticleMode::Improved),
            Some(ModeWord::Paper) => Ok(ParticleMode::Paper),
            Some(ModeWord::Layered | ModeWord::Local) => {
                Err(Error::argument("mode", "improved or paper for particle", "a mode of gradient"))
            }
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

fn parse_eps(text: &str) -> std::result::Result<Eps, String> {
    match text.parse::<f64>() {
        _ if text == "auto" => Ok(Eps::Auto),
        Ok(speed) if speed >= 0.0 && speed.is_finite() => Ok(Eps::Speed(speed)),
        _ => Err("expected a speed in px/frame of at least 0, or auto".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_points_and_speeds_are_read() {
        assert_eq!(parse_box("-1.5, 2,13,5"), Ok(TargetBox { x: -1.5, y: 2.0, width: 13.0, height: 5.0 }));
        for wrong in ["1,2,3", "1,2,0,3", "1,2,3,4,5", "1,2,nan,3", "a,b,c,d", ""] {
            assert!(parse_box(wrong).is_err(), "{wrong}");
        }
        assert_eq!(parse_point("3.5,-4"), Ok([3.5, -4.0]));
        assert!(parse_point("3").is_err() && parse_point("inf,1").is_err());
        assert_eq!((parse_eps("auto"), parse_eps("0.3")), (Ok(Eps::Auto), Ok(Eps::Speed(0.3))));
        assert!(parse_eps("-1").is_err() && parse_eps("slow").is_err() && parse_eps("nan").is_err());
    }

    #[test]
    fn boxes_come_before_points_and_nothing_means_what_moves() {
        let none = TargetArguments { boxes: vec![], points: vec![] };
        assert_eq!(none.starts(), [Start::Motion]);
        let bounds = TargetBox { x: 1.0, y: 2.0, width: 3.0, height: 4.0 };
        let both = TargetArguments { boxes: vec![bounds], points: vec![[5.0, 6.0]] };
        assert_eq!(both.starts(), [Start::Box(bounds), Start::Centre([5.0, 6.0])]);
    }
}
