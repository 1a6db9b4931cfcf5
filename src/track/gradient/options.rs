//! How the gradient tracker works.

use crate::error::{Error, Result};
use crate::types::TargetBox;

/// Which system follows the target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    /// Target and background as layers, one gradient step over the whole segmented target from the
    /// prediction. The default.
    #[default]
    Layered,
    /// The paper's loop: local flow in a moving window, its mean over what moves, a Gauss-Markov Kalman
    /// filter; with the repairs that it needs.
    Local,
    /// The paper's text to the letter, for comparison: it loses targets on all but flat backgrounds.
    Paper,
}

impl Mode {
    /// Every mode.
    pub const ALL: [Self; 3] = [Self::Layered, Self::Local, Self::Paper];

    /// The word used in Python and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Layered => "layered",
            Self::Local => "local",
            Self::Paper => "paper",
        }
    }
}

/// How the window of `local` follows the filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Control {
    /// In whole pixels.
    #[default]
    Integer,
    /// To fractions of a pixel; pictures are cut bilinearly.
    Subpixel,
}

/// What the target's picture does besides moving (`layered`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Shape {
    /// It turns and grows: four unknowns. The default.
    #[default]
    Similarity,
    /// Any affine map: six unknowns, for targets that are stretched.
    Affine,
}

/// What the camera does (`layered`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum CameraMotion {
    /// It may move: the still scene is aligned from frame to frame where that pays. The default.
    #[default]
    Auto,
    /// It stands still.
    None,
}

/// What is known of the target in the first frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Start {
    /// Nothing: the first thing that moves.
    #[default]
    Motion,
    /// A point on it, `(x, y)` px: what moves nearest to that.
    Centre([f64; 2]),
    /// Its box.
    Box(TargetBox),
}

/// Options of the gradient tracker. The spec of each mode's constants is in the modules that use them.
#[derive(Debug, Clone, PartialEq)]
pub struct GradientOptions {
    /// Which system.
    pub mode: Mode,
    /// Side of the window that is looked at, px (`local`, `paper`), made odd; `None` (default): 51, or 1.6
    /// times the longer side of the target's box where that is more.
    pub fov: Option<usize>,
    /// How that window moves; default whole pixels.
    pub control: Control,
    /// Side of the windows of local flow, px: 3, 5 or 7; default 7 (`paper` 5).
    pub window: Option<usize>,
    /// Degree of the polynomials behind the derivatives, 1 to 4; default 4 (`paper` 2).
    pub order: Option<usize>,
    /// Slowest flow that counts as motion, px/frame; `None`: three deviations of the flow outside the target,
    /// at least 0.3. Default 0.5.
    pub eps: Option<f64>,
    /// What the target may do; default similarity.
    pub shape: Shape,
    /// What the camera may do; default anything.
    pub camera: CameraMotion,
}

impl Default for GradientOptions {
    fn default() -> Self {
        Self {
            mode: Mode::default(),
            fov: None,
            control: Control::default(),
            window: None,
            order: None,
            eps: Some(0.5),
            shape: Shape::default(),
            camera: CameraMotion::default(),
        }
    }
}

impl GradientOptions {
    /// Checks every option, and that none is given which the mode does not heed.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the option.
    pub fn check(&self) -> Result<()> {
        if let Some(fov) = self.fov.filter(|fov| *fov < 15) {
            return Err(Error::argument("fov", "at least 15 px", fov));
        }
        if let Some(window) = self.window.filter(|w| ![3, 5, 7].contains(w)) {
            return Err(Error::argument("window", "3, 5 or 7 px", window));
        }
        if let Some(order) = self.order.filter(|n| !(1..=4).contains(n)) {
            return Err(Error::argument("order", "1, 2, 3 or 4", order));
        }
        if let Some(eps) = self.eps.filter(|e| !(*e >= 0.0 && e.is_finite())) {
            return Err(Error::argument("eps", "a speed in px/frame, at least 0", eps));
        }
        self.check_mode()
    }

    /// Options that the mode does not heed must be left at their defaults.
    fn check_mode(&self) -> Result<()> {
        let default = Self::default();
        let of_window = [
            ("fov", self.fov.is_some()),
            ("control", self.control != default.control),
            ("window", self.window.is_some()),
            ("order", self.order.is_some()),
            ("eps", self.eps != default.eps),
        ];
        let of_layers = [("model", self.shape != default.shape)];
        let (others, mode) = if self.mode == Mode::Layered {
            (&of_window[..], "local or paper")
        } else {
            (&of_layers[..], Mode::Layered.name())
        };
        match others.iter().find(|(_, given)| *given) {
            Some((option, _)) => Err(self.no_such_option(option, mode)),
            None => Ok(()),
        }
    }

    /// Only the layered tracker heeds a moving camera; the others do while they look for what moves first.
    pub(super) fn check_camera(&self, start: Start) -> Result<()> {
        let heeded = self.mode == Mode::Layered || !matches!(start, Start::Box(_));
        if heeded || self.camera == Self::default().camera {
            return Ok(());
        }
        Err(self.no_such_option("camera", "layered, or without a box"))
    }

    /// The error about an option that has no effect.
    fn no_such_option(&self, option: &'static str, mode: &str) -> Error {
        Error::argument(option, format!("no such option, which is for {mode}, here"), self.mode.name())
    }
}
