//! The gradient tracker: a moving target followed by the gradient equation, a prediction and a moving window.
//!
//! Source: M. Chiba and S. Ozawa, "A Tracking Algorithm for a Video Target Using Gradient-Based Method"
//! (IPSJ).
//!
//! Three systems follow the target ([`Mode`]): the paper's loop to the letter, the same with the repairs that
//! it needs, and one that keeps its idea (the gradient equation, a prediction in place of iterations, a
//! stopped background, a Gauss-Markov filter) but solves the equation once over the whole segmented target.

mod detect;
mod equations;
mod extent;
mod gauss_markov;
mod kernels;
mod layered;
mod local;
mod local_flow;
mod options;
mod refine;
mod rules;
mod window;

pub use detect::{MovingTarget, detect_moving_target};
pub use gauss_markov::{Dynamics, GaussMarkovFilter, Measurement, Velocity};
pub use kernels::{DerivativeKernels, KernelMask, derivative_kernels};
pub use local_flow::{LocalFlow, LocalFlowOptions, MeanFlow, local_flow};
pub use options::{CameraMotion, Control, GradientOptions, Mode, Shape, Start};
pub use refine::{RefineOptions, refine_flow};

use super::Tracker;
use super::grey_levels::GREATEST;
use crate::error::{Error, Result};
use crate::image::all_finite;
use crate::types::{Frame, TargetBox, TrackState, TrackStatus};
use layered::Layered;
use local::LocalLoop;

/// Smallest side of a frame, px.
const LEAST_FRAME: usize = 16;
/// Smallest side of a target, px.
const LEAST_BOX: f64 = 3.0;

/// Largest box, in sides of the frame.
const LARGEST_BOX: f64 = 2.0;

/// What follows the target.
#[derive(Debug)]
enum Engine {
    /// Nothing has moved yet: the last frame, and where to look.
    Waiting(Frame<f64>, Option<[f64; 2]>),
    Local(Box<LocalLoop>),
    Layered(Box<Layered>),
}

impl Engine {
    /// Begins with a box in a frame.
    fn new(frame: &Frame<f64>, bounds: TargetBox, options: &GradientOptions) -> Self {
        match options.mode {
            Mode::Layered => Self::Layered(Box::new(Layered::new(frame.clone(), bounds, options))),
            Mode::Local | Mode::Paper => Self::Local(Box::new(LocalLoop::new(frame, bounds, options))),
        }
    }

    /// The target at the beginning.
    fn begun(&self, bounds: TargetBox) -> TrackState {
        let covariance = match self {
            Self::Waiting(..) => [[[f64::NAN; 3]; 3]; 2],
            Self::Local(engine) => engine.covariance(),
            Self::Layered(engine) => engine.covariance(),
        };
        let fov = if let Self::Local(engine) = self { engine.fov() } else { f64::NAN };
        TrackState { covariance, fov, ..TrackState::at(bounds.centre(), bounds) }
    }
}

/// Follows one target.
#[derive(Debug)]
pub struct GradientTracker {
    state: TrackState,
    size: (usize, usize),
    options: GradientOptions,
    engine: Engine,
}

impl GradientTracker {
    /// Begins with the first frame. Without a box the target is what moves first ([`detect_moving_target`]):
    /// until then its status is lost and its box empty.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `frame` (smaller than 16 px a side, not finite), `bbox` (a side under 3 px,
    /// wholly outside, not finite), `center` (outside) or the option.
    pub fn new(frame: &Frame<f64>, start: Start, options: &GradientOptions) -> Result<Self> {
        options.check()?;
        options.check_camera(start)?;
        check_frame(frame)?;
        let (state, engine) = match start {
            Start::Box(bounds) => {
                let bounds = checked_box(bounds, frame.size())?;
                let engine = Engine::new(frame, bounds, options);
                (engine.begun(bounds), engine)
            }
            Start::Centre(at) => {
                (nothing_yet(checked_point(at, frame.size())?), Engine::Waiting(frame.clone(), Some(at)))
            }
            Start::Motion => {
                let middle = [frame.width() as f64 / 2.0 - 0.5, frame.height() as f64 / 2.0 - 0.5];
                (nothing_yet(middle), Engine::Waiting(frame.clone(), None))
            }
        };
        Ok(Self { state, size: frame.size(), options: options.clone(), engine })
    }

    /// Looks for what moves first.
    fn wait(&mut self, frame: &Frame<f64>) {
        let Engine::Waiting(previous, near) = &mut self.engine else { return };
        let still = match self.options.camera {
            CameraMotion::Auto if detect::much_changes(previous, frame) => layered::stilled(previous, frame),
            CameraMotion::Auto | CameraMotion::None => None,
        };
        let found = detect_moving_target(still.as_ref().unwrap_or(previous), frame, *near).map(|found| found.bounds);
        match found.and_then(|bounds| checked_box(bounds, self.size).ok()) {
            Some(bounds) => {
                let engine = Engine::new(frame, bounds, &self.options);
                let state = engine.begun(bounds);
                self.state = TrackState { frame: self.state.frame, reason: "the first thing that moves", ..state };
                self.engine = engine;
            }
            None => *previous = frame.clone(),
        }
    }
}

/// A target that has not moved yet.
fn nothing_yet(at: [f64; 2]) -> TrackState {
    TrackState {
        status: TrackStatus::Lost,
        reason: "nothing has moved yet",
        visibility: 0.0,
        covariance: [[[f64::NAN; 3]; 3]; 2],
        ..TrackState::at(at, TargetBox::about(at, 0.0, 0.0))
    }
}

/// A point in the frame.
fn checked_point(at: [f64; 2], (width, height): (usize, usize)) -> Result<[f64; 2]> {
    // Pixels reach half a pixel beyond their centres.
    let inside = |at: f64, length: usize| at >= -0.5 && at < length as f64 - 0.5;
    if inside(at[0], width) && inside(at[1], height) {
        return Ok(at);
    }
    let expected = format!("a point (x, y) in the {width} x {height} frame");
    Err(Error::argument("center", expected, format!("({}, {})", at[0], at[1])))
}

/// The first frame must be usable.
fn check_frame(frame: &Frame<f64>) -> Result<()> {
    let (width, height) = frame.size();
    if width < LEAST_FRAME || height < LEAST_FRAME {
        let expected = format!("a frame of at least {LEAST_FRAME} x {LEAST_FRAME} px");
        return Err(Error::argument("frame", expected, format!("{width} x {height}")));
    }
    if !all_finite(frame) {
        return Err(Error::argument("frame", "finite samples in the first frame", "NaN or infinity"));
    }
    if let Some(sample) = frame.data().iter().find(|sample| sample.abs() > GREATEST) {
        let expected = format!("samples of at most {GREATEST:e} grey levels in the first frame");
        return Err(Error::argument("frame", expected, format!("{sample:e}")));
    }
    Ok(())
}

/// Whether a frame holds brightness, and nothing else.
fn is_usable(frame: &Frame<f64>) -> bool {
    // NaN is greater than nothing, and infinity greater than all.
    let greatest = frame.data().iter().fold(0.0, |greatest: f64, sample| greatest.max(sample.abs()));
    greatest <= GREATEST && all_finite(frame)
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
    if w > LARGEST_BOX * width as f64 || h > LARGEST_BOX * height as f64 {
        let expected = format!("a box at most {LARGEST_BOX} times as large as the {width} x {height} frame");
        return Err(Error::argument("bbox", expected, told()));
    }
    // Pixels reach half a pixel beyond their centres.
    let apart = |from: f64, length: f64, whole: usize| from + length <= -0.5 || from >= whole as f64 - 0.5;
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
        let usable = is_usable(frame);
        self.state.frame += 1;
        match &mut self.engine {
            Engine::Waiting(..) if usable => self.wait(frame),
            Engine::Waiting(..) => {}
            Engine::Local(engine) => engine.update(usable.then_some(frame), &mut self.state),
            Engine::Layered(engine) => engine.update(usable.then_some(frame), &mut self.state),
        }
        Ok(self.state.clone())
    }

    fn state(&self) -> &TrackState {
        &self.state
    }
}
