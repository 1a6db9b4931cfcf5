//! Which states of a batch could not make a step.

use crate::error::{Error, Result};

/// The states that failed in a step, and the first reason.
pub(super) struct Failures {
    marks: Vec<bool>,
    first: Option<Error>,
}

impl Failures {
    pub(super) fn none(batch: usize) -> Self {
        Self { marks: vec![false; batch], first: None }
    }

    pub(super) fn has(&self, item: usize) -> bool {
        self.marks[item]
    }

    pub(super) fn add(&mut self, item: usize, reason: Error) {
        self.marks[item] = true;
        self.first.get_or_insert(reason);
    }

    /// Marks the states for which a function's results, equally many for each, are not finite, and replaces
    /// these by zeros.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the function when no state is left.
    pub(super) fn add_infinite(&mut self, name: &'static str, results: &mut [f64]) -> Result<()> {
        let width = results.len() / self.marks.len();
        for (item, results) in results.chunks_exact_mut(width).enumerate() {
            if let Some(value) = results.iter().find(|v| !v.is_finite()) {
                self.add(item, Error::argument(name, "a function with finite results", value));
                results.fill(0.0);
            }
        }
        self.check()
    }

    /// As [`add_infinite`](Self::add_infinite), for a function in place of vector arithmetic. A state for
    /// which `plain`, the result of that arithmetic, is not finite either has left the range of numbers: its
    /// function is not at fault.
    ///
    /// # Errors
    /// [`Error::Numerical`] too when no state is left.
    pub(super) fn add_out_of_range(&mut self, name: &'static str, results: &mut [f64], plain: &[f64]) -> Result<()> {
        let width = results.len() / self.marks.len();
        for (item, (results, plain)) in results.chunks_exact_mut(width).zip(plain.chunks_exact(width)).enumerate() {
            let is_finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
            if !is_finite(results) && !is_finite(plain) {
                self.add(item, Error::Numerical(format!("the step of state {item} has outgrown the range of numbers")));
                results.fill(0.0);
            }
        }
        self.add_infinite(name, results)
    }

    /// The first reason when every state failed.
    pub(super) fn check(&mut self) -> Result<()> {
        match self.first.take_if(|_| self.marks.iter().all(|failed| *failed)) {
            Some(reason) => Err(reason),
            None => Ok(()),
        }
    }
}
