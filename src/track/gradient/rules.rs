//! What the paper's loop does to the letter, and what with the repairs that it needs.

use super::gauss_markov::{Dynamics, Velocity};
use super::kernels::gradient_of_rounding;
use super::local_flow::LocalFlowOptions;
use super::options::{GradientOptions, Mode};

/// What is done, in all that the modes differ by.
#[derive(Debug, Clone)]
pub(super) struct Rules {
    pub flow: LocalFlowOptions,
    /// Gradient up to which a window is flat, grey levels/px. Without a gate for weak gradients it is what
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
    pub fn of(options: &GradientOptions) -> Self {
        let mut rules = if options.mode == Mode::Paper { Self::paper() } else { Self::repaired() };
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
