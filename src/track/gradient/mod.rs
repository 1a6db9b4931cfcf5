//! The gradient tracker: a moving target followed by the gradient equation, a prediction and a moving window.
//!
//! Source: M. Chiba and S. Ozawa, "A Tracking Algorithm for a Video Target Using Gradient-Based Method" (IPSJ).
//!
//! Three systems follow the target ([`Mode`]): the paper's loop to the letter, the same with the repairs that it needs, and one that keeps its idea (the gradient equation, a
//! prediction in place of iterations, a stopped background, a Gauss-Markov filter) but solves the equation once over the whole segmented target.

mod gauss_markov;
mod kernels;
mod layered;
mod local;
mod local_flow;
mod options;
mod refine;

pub use gauss_markov::{Dynamics, GaussMarkovFilter, Measurement, Velocity};
pub use kernels::{DerivativeKernels, KernelMask, derivative_kernels};
pub use local_flow::{LocalFlow, LocalFlowOptions, MeanFlow, local_flow};
pub use options::{CameraMotion, Control, GradientOptions, Mode, Shape, Start};
pub use refine::{RefineOptions, refine_flow};

use super::Tracker;
use crate::error::{Error, Result};
use crate::types::{Frame, TargetBox, TrackState};
use layered::Layered;
use local::LocalLoop;

/// Smallest side of a frame, px.
const LEAST_FRAME: usize = 16;
/// Smallest side of a target, px.
const LEAST_BOX: f64 = 3.0;

/// What follows the target.
#[derive(Debug)]
enum Engine {
    Local(Box<LocalLoop>),
    Layered(Box<Layered>),
}

/// Follows one target.
#[derive(Debug)]
pub struct GradientTracker {
    state: TrackState,
    size: (usize, usize),
    engine: Engine,
}

impl GradientTracker {
    /// Begins with the first frame.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `frame` (smaller than 16 px a side, not finite), `bbox` (a side under 3 px, wholly outside, not finite), `center` (outside) or the option.
    pub fn new(frame: &Frame<f64>, start: Start, options: &GradientOptions) -> Result<Self> {
        options.check()?;
        check_frame(frame)?;
        let bounds = match start {
            Start::Box(bounds) => checked_box(bounds, frame.size())?,
            _ => TargetBox::about([0.0; 2], 3.0, 3.0),
        };
        let engine = match options.mode {
            Mode::Layered => Engine::Layered(Box::new(Layered::new(frame.clone(), bounds, options))),
            Mode::Local | Mode::Paper => Engine::Local(Box::new(LocalLoop::new(frame.clone(), bounds, options))),
        };
        Ok(Self { state: TrackState::at(bounds.centre(), bounds), size: frame.size(), engine })
    }
}

/// The first frame must be usable.
fn check_frame(frame: &Frame<f64>) -> Result<()> {
    let (width, height) = frame.size();
    if width < LEAST_FRAME || height < LEAST_FRAME {
        let expected = format!("a frame of at least {LEAST_FRAME} x {LEAST_FRAME} px");
        return Err(Error::argument("frame", expected, format!("{width} x {height}")));
    }
    if frame.data().iter().any(|value| !value.is_finite()) {
        return Err(Error::argument("frame", "finite samples in the first frame", "NaN or infinity"));
    }
    Ok(())
}

/// A box that holds something of the frame.
fn checked_box(bounds: TargetBox, (width, height): (usize, usize)) -> Result<TargetBox> {
    let TargetBox { x, y, width: w, height: h } = bounds;
    let told = || format!("x {x}, y {y}, width {w}, height {h}");
    if ![x, y, w, h].iter().all(|value| value.is_finite()) || w < LEAST_BOX || h < LEAST_BOX {
        return Err(Error::argument(
            "bbox",
            format!("finite (x, y, width, height), sides of at least {LEAST_BOX} px"),
            told(),
        ));
    }
    let apart = |from: f64, length: f64, whole: usize| from + length <= 0.0 || from >= whole as f64;
    if apart(x, w, width) || apart(y, h, height) {
        return Err(Error::argument(
            "bbox",
            format!("a box that holds something of the {width} x {height} frame"),
            told(),
        ));
    }
    Ok(bounds)
}

impl Tracker for GradientTracker {
    fn method(&self) -> &'static str {
        "gradient"
    }

    fn update(&mut self, frame: &Frame<f64>) -> Result<TrackState> {
        if frame.size() != self.size {
            let told = |(width, height): (usize, usize)| format!("{width} x {height} px");
            return Err(Error::argument(
                "frame",
                format!("as large as the first, {}", told(self.size)),
                told(frame.size()),
            ));
        }
        let usable = frame.data().iter().all(|value| value.is_finite());
        self.state.frame += 1;
        match &mut self.engine {
            Engine::Local(engine) => engine.update(usable.then_some(frame), &mut self.state),
            Engine::Layered(engine) => engine.update(usable.then_some(frame), &mut self.state),
        }
        Ok(self.state.clone())
    }

    fn state(&self) -> &TrackState {
        &self.state
    }
}
