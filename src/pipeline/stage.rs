//! The step in the middle: from frames to flow fields.

use crate::error::{Error, Result};
use crate::flow::Estimator;
use crate::io::Element;
use crate::simd::SimdReal;
use crate::temporal::{FlowFilter, FlowFilterOptions, RecursiveFusion, RecursiveOptions};
use crate::types::{FlowField, Frame};
use std::collections::VecDeque;
use std::path::Path;
use std::sync::Arc;

/// A field with the (prepared) frame that it belongs to.
pub type Output<T> = (FlowField<T>, Arc<Frame<T>>);

/// Turns frames, pushed in their order, into fields.
pub trait Stage<T>: Send {
    /// Frames that must have come before the first field.
    fn frames_needed(&self) -> usize;
    /// Takes the next frame; gives a field once enough frames have come.
    ///
    /// The field's `frame_index` counts pushed frames from 0.
    ///
    /// # Errors
    /// Those of the estimator or filter.
    fn push(&mut self, frame: Arc<Frame<T>>) -> Result<Option<Output<T>>>;
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

/// An [`Estimator`] with a memory of the few frames that it needs, and of the estimates before where they are
/// fused over time.
pub struct EstimatorStage<T> {
    estimator: Estimator,
    needed: usize,
    ring: VecDeque<Arc<Frame<T>>>,
    pushed: usize,
    fusion: Option<RecursiveFusion<T>>,
}

impl<T: SimdReal> EstimatorStage<T> {
    /// A stage without frames yet.
    pub fn new(estimator: Estimator) -> Self {
        let needed = estimator.frames_needed();
        Self { estimator, needed, ring: VecDeque::with_capacity(needed + 1), pushed: 0, fusion: None }
    }

    /// As [`EstimatorStage::new`]; with options its estimates are fused over time.
    ///
    /// # Errors
    /// Those of [`RecursiveFusion::new`].
    pub fn recursive(estimator: Estimator, options: Option<RecursiveOptions>) -> Result<Self> {
        let fusion = options.map(|options| RecursiveFusion::new(&estimator, options)).transpose()?;
        Ok(Self { fusion, ..Self::new(estimator) })
    }
}

impl<T: SimdReal> Stage<T> for EstimatorStage<T> {
    fn frames_needed(&self) -> usize {
        self.needed
    }

    fn push(&mut self, frame: Arc<Frame<T>>) -> Result<Option<Output<T>>> {
        let needed = self.needed;
        self.ring.push_back(frame);
        self.pushed += 1;
        if self.ring.len() > needed {
            self.ring.pop_front();
        }
        if self.ring.len() < needed {
            return Ok(None);
        }
        let first = self.pushed - needed;
        let frames: Vec<&Frame<T>> = self.ring.iter().map(AsRef::as_ref).collect();
        let mut field = self.estimator.estimate(&frames, first)?;
        if let Some(fusion) = &mut self.fusion {
            fusion.fuse(&mut field)?;
        }
        let place = field.layout.frame_index.saturating_sub(first).min(needed - 1);
        let frame = Arc::clone(&self.ring[place]);
        Ok(Some((field, frame)))
    }
}

/// A [`FlowFilter`]: a field for every frame, the first included.
///
/// The filter is made when the first frame has come and told its size, unless one is brought along to be
/// continued.
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
    /// The filter, once there is one.
    pub fn filter(&self) -> Option<&FlowFilter<T>> {
        self.filter.as_ref()
    }
}

impl<T: SimdReal + Element> Stage<T> for FilterStage<T> {
    fn frames_needed(&self) -> usize {
        1
    }

    fn push(&mut self, frame: Arc<Frame<T>>) -> Result<Option<Output<T>>> {
        let filter = match &mut self.filter {
            Some(filter) => filter,
            empty => empty.insert(FlowFilter::new(frame.size(), self.options.clone())?),
        };
        let mut field = filter.push(&frame)?;
        // A resumed filter counts the frames of its whole life; the run counts its own.
        field.layout.frame_index = self.pushed;
        self.pushed += 1;
        Ok(Some((field, frame)))
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
