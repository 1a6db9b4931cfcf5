//! Results kept in memory.

use super::{Ending, Sink, Step};
use crate::error::Result;
use crate::math::Real;
use crate::types::FlowField;
use std::sync::{Arc, Mutex, PoisonError};

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
