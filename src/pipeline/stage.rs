//! The step in the middle: from frames to flow fields.

use crate::error::{Error, Result};
use crate::io::Element;
use crate::simd::SimdReal;
use crate::temporal::{FlowFilter, FlowFilterOptions, FlowStream};
use crate::types::{AnyFrame, FlowField, Frame};
use std::path::Path;
use std::sync::Arc;

/// A field with the (prepared) frame that it belongs to.
pub type Output<T> = (FlowField<T>, Arc<Frame<T>>);

/// Turns frames, pushed in their order, into fields.
pub trait Stage<T>: Send {
    /// Frames that must have come before the first field.
    fn frames_needed(&self) -> usize;
    /// Takes the next frame and its time, s, where the source has times; gives a field once enough frames
    /// have come.
    ///
    /// The field's `frame_index` counts pushed frames from 0.
    fn push(&mut self, frame: AnyFrame, time: Option<f64>) -> Result<Option<Output<T>>>;
    /// How often a filter had to restart a pixel.
    fn repairs(&self) -> usize {
        0
    }
    /// Saves the state from which a later run can go on.
    ///
    /// # Errors
    /// [`Error::Argument`] for a stage that has none; [`Error::Io`].
    fn save(&self, path: &Path) -> Result<()> {
        let _ = path;
        Err(Error::argument("save_state", "a filter, which has a state", "an estimator"))
    }
}

impl<T: SimdReal> Stage<T> for FlowStream<T> {
    fn frames_needed(&self) -> usize {
        self.plan().estimator().frames_needed()
    }

    fn push(&mut self, frame: AnyFrame, time: Option<f64>) -> Result<Option<Output<T>>> {
        let Some(field) = self.push_at(frame, time)? else { return Ok(None) };
        Ok(self.reference_frame().map(|frame| (field, Arc::clone(frame))))
    }
}

/// A [`FlowFilter`]: a field for every frame, the first included.
///
/// The filter is created with the first frame, whose size it needs, unless a saved one is resumed.
pub struct FilterStage<T> {
    options: FlowFilterOptions,
    filter: Option<FlowFilter<T>>,
    pushed: usize,
}

impl<T: SimdReal> FilterStage<T> {
    /// A filter that starts with the first frame.
    pub fn new(options: FlowFilterOptions) -> Self {
        Self { options, filter: None, pushed: 0 }
    }

    /// A filter that goes on from its saved state.
    pub fn resume(filter: FlowFilter<T>) -> Self {
        Self { options: filter.options().clone(), filter: Some(filter), pushed: 0 }
    }

    /// The filter's options.
    pub fn options(&self) -> &FlowFilterOptions {
        &self.options
    }
}

impl<T: SimdReal + Element> Stage<T> for FilterStage<T> {
    fn frames_needed(&self) -> usize {
        1
    }

    /// The filter's step is one frame at any time.
    fn push(&mut self, frame: AnyFrame, _time: Option<f64>) -> Result<Option<Output<T>>> {
        let filter = match &mut self.filter {
            Some(filter) => filter,
            empty => empty.insert(FlowFilter::new(frame.size(), self.options.clone())?),
        };
        let frame = filter.prepare(frame.to_real());
        let mut field = filter.push(&frame)?;
        // A resumed filter counts the frames of its whole life; the run counts its own.
        field.layout.frame_index = self.pushed;
        self.pushed += 1;
        Ok(Some((field, Arc::new(frame))))
    }

    fn repairs(&self) -> usize {
        self.filter.as_ref().map_or(0, |filter| filter.repairs() as usize)
    }

    fn save(&self, path: &Path) -> Result<()> {
        match &self.filter {
            Some(filter) => filter.save(path),
            None => Err(Error::argument("save_state", "at least one filtered frame", 0)),
        }
    }
}
