//! Fields: one file for every field and format, or kept in memory.

use super::{Ending, Sink, Step};
use crate::error::Result;
use crate::io::Element;
use crate::math::Real;
use crate::pipeline::output::{OutputPlan, Place, too_many};
use crate::types::FlowField;
use std::collections::HashSet;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// Writes each field in the formats of a plan.
///
/// Where one file was named, nothing is written before it is certain that there is one field only.
#[derive(Debug)]
pub struct Fields<T> {
    plan: OutputPlan,
    options: String,
    waiting: Option<FlowField<T>>,
    written: usize,
    frames: HashSet<usize>,
    latest: Option<PathBuf>,
}

impl<T: Real + Element> Fields<T> {
    /// A writer for the formats of `plan`; `options` says (in JSON) how the fields were made.
    pub fn new(plan: OutputPlan, options: String) -> Self {
        Self { plan, options, waiting: None, written: 0, frames: HashSet::new(), latest: None }
    }

    fn write(&mut self, field: &FlowField<T>) -> Result<()> {
        self.frames.insert(field.layout.frame_index);
        for format in &self.plan.formats {
            if let Some(path) = self.plan.field_path(field.layout.frame_index, *format) {
                format.write(&path, field, &self.options)?;
                self.written += 1;
                self.latest = Some(path);
            }
        }
        Ok(())
    }
}

impl<T: Real + Element> Sink<Step<'_, T>> for Fields<T> {
    fn accept(&mut self, step: &Step<'_, T>) -> Result<()> {
        let Place::Single(stem) = &self.plan.place else { return self.write(step.field) };
        if self.waiting.is_some() {
            let path = self.plan.formats.first().and_then(|format| self.plan.field_path(0, *format));
            return Err(too_many(path.as_ref().unwrap_or(stem), "several"));
        }
        self.waiting = Some(step.field.clone());
        Ok(())
    }

    fn finish(&mut self, ending: Ending) -> Result<()> {
        match self.waiting.take() {
            Some(field) if ending == Ending::Complete => self.write(&field),
            None if ending == Ending::Complete => self.plan.remove_stale(&self.plan.field_files(), &self.frames),
            _ => Ok(()),
        }
    }

    fn files(&self) -> (usize, Option<PathBuf>) {
        (self.written, self.latest.clone())
    }
}

/// Keeps every field. Memory grows with the sequence; meant for short ones and tests.
#[derive(Debug)]
pub struct Collect<T> {
    fields: Arc<Mutex<Vec<FlowField<T>>>>,
}

impl<T: Real> Default for Collect<T> {
    fn default() -> Self {
        Self { fields: Arc::default() }
    }
}

impl<T: Real> Collect<T> {
    /// A second handle on the same fields, to read them while or after the sink is in a pipeline.
    pub fn handle(&self) -> Arc<Mutex<Vec<FlowField<T>>>> {
        Arc::clone(&self.fields)
    }
}

impl<T: Real> Sink<Step<'_, T>> for Collect<T> {
    fn accept(&mut self, step: &Step<'_, T>) -> Result<()> {
        self.fields.lock().unwrap_or_else(PoisonError::into_inner).push(step.field.clone());
        Ok(())
    }
    fn finish(&mut self, _ending: Ending) -> Result<()> {
        Ok(())
    }
}
