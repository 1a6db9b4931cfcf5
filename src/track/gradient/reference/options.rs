//! Options of the paper's loop, and what its two methods differ by.

use super::kernels::gradient_of_rounding;
use crate::error::{Error, Result};
use crate::track::gradient::{gauss_markov::Dynamics, gauss_markov::Velocity, options::CameraMotion};

/// How local flow is computed and what is accepted of it.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LocalFlowOptions {
    /// Side of the window of equations, px, odd.
    pub window: usize,
    /// Degree of the polynomials behind the derivatives, 1 to 4.
    pub order: usize,
    /// Largest condition number `sqrt(lambda_max / lambda_min)` of the gradients in the window (8).
    pub cond_max: f64,
    /// Least gradient along the weaker direction, `sqrt(lambda_min / m)`, grey levels/px. Above 0 it is at
    /// least 0.7 times the noise of the frames: the condition number does not change with contrast, so that
    /// weak texture and noise pass it.
    pub min_sigma: f64,
    /// Longest step of one solution (4), px.
    pub step_max: f64,
}

impl Default for LocalFlowOptions {
    fn default() -> Self {
        Self { window: 7, order: 4, cond_max: 10.0, min_sigma: 2.5, step_max: 4.0 }
    }
}

/// Which variant of the loop follows the target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub enum Method {
    /// With the repairs that it needs. The default.
    #[default]
    Local,
    /// The text to the letter: it loses targets on all but flat backgrounds.
    Paper,
}

/// How the window follows the filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub enum Control {
    /// In whole pixels.
    #[default]
    Integer,
    /// To fractions of a pixel; pictures are cut bilinearly.
    Subpixel,
}

/// Options of the paper's loop.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ReferenceOptions {
    /// Which variant.
    pub method: Method,
    /// Side of the window that is searched, px, made odd; `None`: 51, or 1.6 times the longer side of the
    /// target's box where that is more.
    pub search_window: Option<usize>,
    /// How that window moves; default whole pixels.
    pub control: Control,
    /// Side of the windows of local flow, px: 3, 5 or 7; default 7 (`paper` 5).
    pub window: Option<usize>,
    /// Degree of the polynomials behind the derivatives, 1 to 4; default 4 (`paper` 2).
    pub order: Option<usize>,
    /// Slowest flow that counts as motion, px/frame; `None`: three standard deviations of the flow outside
    /// the target, at least 0.3. Default 0.5.
    pub min_speed: Option<f64>,
    /// What the camera may do until the target moves; default anything.
    pub camera: CameraMotion,
}

impl Default for ReferenceOptions {
    fn default() -> Self {
        Self {
            method: Method::default(),
            search_window: None,
            control: Control::default(),
            window: None,
            order: None,
            min_speed: Some(0.5),
            camera: CameraMotion::default(),
        }
    }
}

impl ReferenceOptions {
    /// Checks every option.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the option.
    pub fn check(&self) -> Result<()> {
        if let Some(side) = self.search_window.filter(|side| *side < 15) {
            return Err(Error::argument("search_window", "at least 15 px", side));
        }
        if let Some(window) = self.window.filter(|w| ![3, 5, 7].contains(w)) {
            return Err(Error::argument("window", "3, 5 or 7 px", window));
        }
        if let Some(order) = self.order.filter(|n| !(1..=4).contains(n)) {
            return Err(Error::argument("order", "1, 2, 3 or 4", order));
        }
        if let Some(speed) = self.min_speed.filter(|e| !(*e >= 0.0 && e.is_finite())) {
            return Err(Error::argument("min_speed", "a speed in px/frame, at least 0", speed));
        }
        Ok(())
    }
}

/// What is done, in all that the modes differ by.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Rules {
    pub flow: LocalFlowOptions,
    /// Gradient up to which a window is flat, grey levels/px. Without a minimum of the gradients it is what
    /// rounding to whole grey levels makes: what interpolation leaves beside an edge would pass for texture.
    pub flat: f64,
    pub dynamics: Dynamics,
    pub velocity: Velocity,
    /// Variances of the measured position and velocity, px^2.
    pub variances: [f64; 2],
    /// How much of the mean flow the centroid is moved by.
    pub brought: f64,
    /// The window follows the filter's position, and not its velocity.
    pub by_position: bool,
    /// Pixels may start at rest.
    pub rest: bool,
    /// Measurements are gated, and targets may stop.
    pub careful: bool,
}

impl Rules {
    /// Those of a mode.
    pub fn of(options: &ReferenceOptions) -> Self {
        let mut rules = if options.method == Method::Paper { Self::paper() } else { Self::repaired() };
        rules.flow.window = options.window.unwrap_or(rules.flow.window);
        rules.flow.order = options.order.unwrap_or(rules.flow.order);
        rules.flat = if rules.flow.min_sigma > 0.0 { 0.0 } else { gradient_of_rounding(rules.flow.order) };
        rules
    }

    fn repaired() -> Self {
        Self {
            flow: LocalFlowOptions::default(),
            flat: 0.0,
            dynamics: Dynamics::default(),
            velocity: Velocity::Mean,
            variances: [1.0, 0.25],
            brought: 1.0,
            by_position: true,
            rest: true,
            careful: true,
        }
    }

    fn paper() -> Self {
        Self {
            flow: LocalFlowOptions { window: 5, order: 2, min_sigma: 0.0, ..LocalFlowOptions::default() },
            flat: 0.0,
            dynamics: Dynamics { q: 0.25, ..Dynamics::default() },
            velocity: Velocity::AsPrinted,
            variances: [4.0, 0.25],
            brought: 0.5,
            by_position: false,
            rest: false,
            careful: false,
        }
    }
}
