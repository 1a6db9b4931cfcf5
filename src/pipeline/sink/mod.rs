//! Where fields go.

mod egomotion;
mod fields;
mod measurements;
mod pictures;
mod table;

pub use egomotion::{Egomotion, EgomotionPlan};
pub use fields::{Collect, Fields};
pub use measurements::{MeasuredRegion, Measurements};
pub use pictures::{PictureRanges, Pictures};
pub(in crate::pipeline) use table::end_table;
pub use table::{Rows, Table, TableTarget, TextFormat};

use super::{output::OutputPlan, output::Place, output::check_writable};
use crate::error::{Error, Result};
use crate::io::Element;
use crate::math::Real;
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

/// A receiver of the results `S` of a run.
pub trait Sink<S>: Send {
    /// Takes one result.
    ///
    /// # Errors
    /// Files that cannot be written; the run then ends.
    fn accept(&mut self, step: &S) -> Result<()>;

    /// Called once at the end, however the run ended: names what is complete and removes the rest.
    ///
    /// # Errors
    /// Files that cannot be written.
    fn finish(&mut self, ending: Ending) -> Result<()>;

    /// Files in place so far: their number and the latest one.
    fn files(&self) -> (usize, Option<PathBuf>) {
        (0, None)
    }
}

/// The end of a sink that writes everything through its field `$field`; `$graph`: what else it is given then.
macro_rules! ends_as {
    ($field:ident $(, $graph:ty)?) => {
        fn finish(&mut self, ending: crate::pipeline::sink::Ending $(, _: $graph)?) -> Result<()> {
            self.$field.finish(ending)
        }

        fn files(&self) -> (usize, Option<PathBuf>) {
            self.$field.files()
        }
    };
}
pub(in crate::pipeline) use ends_as;

/// A receiver of fields.
pub type FieldSink<T> = dyn for<'a> Sink<Step<'a, T>>;

/// Ends every sink, even when an earlier one fails; returns the first error, that of the work included.
pub(in crate::pipeline) fn end_all<S>(
    worked: Result<()>,
    sinks: &mut [S],
    finish: impl Fn(&mut S, Ending) -> Result<()>,
) -> Result<()> {
    let ending = if worked.is_ok() { Ending::Complete } else { Ending::Partial };
    sinks.iter_mut().fold(worked, |result, sink| result.and(finish(sink, ending)))
}

/// How many files all sinks have in place, and the last of them.
pub(in crate::pipeline) fn in_place(files: impl Iterator<Item = (usize, Option<PathBuf>)>) -> (usize, Option<PathBuf>) {
    files.fold((0, None), |(sum, last), (number, latest)| (sum + number, latest.or(last)))
}

impl OutputPlan {
    /// The sinks of this plan, whose folder is made; `options` says (in JSON) how the fields are made.
    ///
    /// # Errors
    /// [`Error::Io`] when the folder cannot be made or written.
    pub fn sinks<T: Real + Element>(&self, options: String, ranges: PictureRanges) -> Result<Vec<Box<FieldSink<T>>>> {
        if let Place::Folder(folder) = &self.place {
            std::fs::create_dir_all(folder).map_err(|source| Error::io(folder, source))?;
            check_writable(folder)?;
        }
        let mut sinks: Vec<Box<FieldSink<T>>> = Vec::new();
        if !self.formats.is_empty() {
            sinks.push(Box::new(Fields::new(self.clone(), options)));
        }
        if !self.pictures.is_empty() {
            sinks.push(Box::new(Pictures::new(self.clone(), ranges)));
        }
        if let Some(target) = &self.table {
            sinks.push(Box::new(Rows::new(target.clone())));
        }
        Ok(sinks)
    }
}
