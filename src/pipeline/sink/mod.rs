//! Where fields go.

mod egomotion;
mod fields;
mod measurements;
mod memory;
mod pictures;
mod table;

pub use egomotion::{Egomotion, EgomotionPlan};
pub use fields::Fields;
pub use measurements::Measurements;
pub use memory::Collect;
pub use pictures::{PictureRanges, Pictures};
pub(in crate::pipeline) use table::end_table;
pub use table::{Rows, Table, TableTarget};

use crate::error::Result;
use crate::types::{FlowField, Frame};
use std::path::PathBuf;

/// One result on its way to the sinks.
#[derive(Debug)]
pub struct Step<'a, T> {
    /// The field; its `frame_index` is the index in the input sequence.
    pub field: &'a FlowField<T>,
    /// The frame it belongs to, after preparation.
    pub frame: &'a Frame<T>,
    /// Time of that frame in seconds, where the frame rate is known.
    pub time: Option<f64>,
}

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// Every frame was worked on.
    Complete,
    /// Stopped by the user or by an error; more results would have come.
    Partial,
}

/// A receiver of results.
pub trait Sink<T>: Send {
    /// Takes one result.
    ///
    /// # Errors
    /// Files that cannot be written; the run then ends.
    fn accept(&mut self, step: &Step<'_, T>) -> Result<()>;

    /// Called once at the end, however the run ended: brings what is complete under its final name and
    /// removes the rest.
    ///
    /// # Errors
    /// Files that cannot be written.
    fn finish(&mut self, ending: Ending) -> Result<()>;

    /// Files in place so far: their number and the latest one.
    fn files(&self) -> (usize, Option<PathBuf>) {
        (0, None)
    }
}
