//! The gradient tracker: a moving target followed by the gradient equation, a prediction and two layers.
//!
//! Source: M. Chiba and S. Ozawa, "A Tracking Algorithm for a Video Target Using Gradient-Based Method"
//! (IPSJ). Their idea is kept (the gradient equation, a prediction in place of iterations, a stopped
//! background, a Gauss-Markov filter), but the equation is solved once for the pose of the whole segmented
//! target. Their own loop is in `reference`, behind the feature of that name.
//!
//! A target starts with a box, or with what moves first (`start`, `detect`); then each frame passes the
//! stages of `layered`, which filters the position by `gauss_markov`. `options` are what it is given; `shift`
//! (pictures between their pixels) and `noise` (robust statistics of brightness) serve all.

mod detect;
mod gauss_markov;
mod layered;
mod noise;
mod options;
#[cfg(feature = "reference")]
pub mod reference;
mod shift;
mod start;

pub use detect::{MovingTarget, detect_moving_target};
pub use gauss_markov::{Dynamics, GaussMarkovFilter, Measurement, Velocity};
pub use options::{CameraMotion, GradientOptions, Shape, Start};

use super::{Tracker, persist::Kind};
use crate::error::{Error, Result};
use crate::types::{Frame, TargetBox, TrackState};
use layered::State;
#[cfg(feature = "reference")]
use reference::{LocalLoop, ReferenceOptions, SearchWindow};
use start::Waiting;

#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
enum Method {
    Layered(GradientOptions),
    #[cfg(feature = "reference")]
    Reference(ReferenceOptions),
}

impl Method {
    fn camera(&self) -> CameraMotion {
        match self {
            Self::Layered(options) => options.camera,
            #[cfg(feature = "reference")]
            Self::Reference(options) => options.camera,
        }
    }

    fn begin(&self, frame: &Frame<f64>, bounds: TargetBox) -> (TrackState, Engine) {
        let (covariance, engine) = match self {
            Self::Layered(options) => {
                let layered = State::new(frame.clone(), bounds, options);
                (layered.covariance(), Engine::Layered(Box::new(layered)))
            }
            #[cfg(feature = "reference")]
            Self::Reference(options) => {
                let local = LocalLoop::new(frame, bounds, options);
                (local.covariance(), Engine::Local(Box::new(local)))
            }
        };
        (TrackState { covariance, ..TrackState::at(bounds.centre(), bounds) }, engine)
    }
}

#[derive(Debug, serde::Serialize, serde::Deserialize)]
enum Engine {
    Waiting(Waiting),
    Layered(Box<State>),
    #[cfg(feature = "reference")]
    Local(Box<LocalLoop>),
}

/// Mark and layout of the tracker as bytes; reductions of the last frame are not among them but made again.
const BYTES: Kind = Kind { mark: *b"JFGT", layout: 1, what: "gradient tracker" };

/// Follows one target.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct GradientTracker {
    state: TrackState,
    size: (usize, usize),
    method: Method,
    engine: Engine,
}

impl GradientTracker {
    /// Begins with the first frame. Without a box the target is what moves first ([`detect_moving_target`]):
    /// until then its status is lost and its box empty.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `frame` (smaller than 16 px a side, mostly not finite), `bbox` (a side
    /// under 3 px, wholly outside or not shown, not finite) or `center` (outside).
    pub fn new(frame: &Frame<f64>, start: Start, options: &GradientOptions) -> Result<Self> {
        Self::begin(frame, start, Method::Layered(options.clone()))
    }

    /// The same with the paper's loop.
    ///
    /// # Errors
    /// As [`GradientTracker::new`], and [`Error::Argument`] naming an option out of range.
    #[cfg(feature = "reference")]
    pub fn reference(frame: &Frame<f64>, start: Start, options: &ReferenceOptions) -> Result<Self> {
        options.check()?;
        Self::begin(frame, start, Method::Reference(options.clone()))
    }

    fn begin(frame: &Frame<f64>, start: Start, method: Method) -> Result<Self> {
        let (whole, frame) = (frame, &*start::first_frame(frame)?);
        let waiting = |near| Engine::Waiting(Waiting::new(frame, near));
        let (state, engine) = match start {
            Start::Box(bounds) => {
                let bounds = start::checked_box(bounds, frame.size())?;
                start::check_shown(whole, bounds)?;
                method.begin(frame, bounds)
            }
            Start::Centre(at) => (start::nothing_yet(start::checked_point(at, frame.size())?), waiting(Some(at))),
            Start::Motion => {
                let middle = [frame.width(), frame.height()].map(|length| length as f64 / 2.0 - 0.5);
                (start::nothing_yet(middle), waiting(None))
            }
        };
        Ok(Self { state, size: frame.size(), method, engine })
    }

    /// The window that the paper's loop searches, once it follows a target.
    #[cfg(feature = "reference")]
    pub fn search_window(&self) -> Option<SearchWindow> {
        if let Engine::Local(local) = &self.engine { Some(local.window()) } else { None }
    }

    /// Everything, as bytes: what they give back goes on as this one would, bit for bit.
    pub fn to_bytes(&self) -> Vec<u8> {
        BYTES.sealed(self)
    }

    /// A tracker from the bytes that [`GradientTracker::to_bytes`] gave.
    ///
    /// # Errors
    /// [`Error::Argument`] named `state` for bytes of another kind or layout, and for damaged ones.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        BYTES.opened(bytes)
    }
}

impl Tracker for GradientTracker {
    fn update(&mut self, frame: &Frame<f64>) -> Result<TrackState> {
        if frame.size() != self.size {
            let size = |(width, height): (usize, usize)| format!("{width} x {height} px");
            let expected = format!("as large as the first, {}", size(self.size));
            return Err(Error::argument("frame", expected, size(frame.size())));
        }
        self.state.frame += 1;
        match &mut self.engine {
            Engine::Waiting(waiting) => {
                let usable = start::completed(frame);
                let found =
                    usable.as_deref().and_then(|frame| Some((frame, waiting.find(frame, self.method.camera())?)));
                if let Some((frame, bounds)) = found {
                    let (state, engine) = self.method.begin(frame, bounds);
                    self.state =
                        TrackState { frame: self.state.frame, reason: "the first object that moves".into(), ..state };
                    self.engine = engine;
                }
            }
            Engine::Layered(state) => layered::update(state, start::seen(frame), &mut self.state),
            #[cfg(feature = "reference")]
            Engine::Local(engine) => engine.update(start::completed(frame).as_deref(), &mut self.state),
        }
        Ok(self.state.clone())
    }

    fn state(&self) -> &TrackState {
        &self.state
    }
}
