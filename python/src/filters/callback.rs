//! Python functions as the core's callbacks.

use crate::arrays;
use crate::errors::{Outcome, Raised};
use jacoflow::error::{Error, Result, shape_text};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};

/// Keeps the Python exception of a callback while the core unwinds with an error of its own.
#[derive(Default)]
pub struct Callbacks {
    raised: Mutex<Option<Raised>>,
}

impl Callbacks {
    /// Hands `inputs` (shape and values) to `function` as arrays and copies its result, which must have shape
    /// `shape_out`, to `out`.
    ///
    /// Called by the core while the interpreter is detached; attaches for the time of the call.
    pub fn call(
        &self,
        name: &'static str,
        inputs: &[(&[usize], &[f64])],
        shape_out: &[usize],
        out: &mut [f64],
        function: impl for<'py> FnOnce(Python<'py>, Vec<Bound<'py, PyAny>>) -> Outcome<Bound<'py, PyAny>>,
    ) -> Result<()> {
        Python::attach(|py| {
            let arrays = inputs.iter().map(|(shape, values)| arrays::owned(py, shape, values.to_vec()));
            let result = function(py, arrays.collect::<Outcome<_>>()?)?;
            let (shape, values) = arrays::doubles(name, &result)?;
            if shape != shape_out {
                let [given, wanted, got] = [inputs[0].0, shape_out, &shape].map(shape_text);
                let expected = format!("a function that returns shape {wanted} for {given}");
                return Err(Error::argument(name, expected, format!("shape {got}")).into());
            }
            out.copy_from_slice(&values);
            Ok(())
        })
        .map_err(|raised: Raised| {
            *self.raised.lock().unwrap_or_else(PoisonError::into_inner) = Some(raised);
            Error::Interrupted
        })
    }

    /// The callback's exception, if one was raised, else the core's error.
    pub fn finish<T>(self, result: Result<T>) -> Outcome<T> {
        match self.raised.into_inner().unwrap_or_else(PoisonError::into_inner) {
            Some(raised) => Err(raised),
            None => Ok(result?),
        }
    }
}

/// `(B, ...)`, or no leading axis without a batch.
pub fn lead(batch: Option<usize>, tail: &[usize]) -> Vec<usize> {
    batch.into_iter().chain(tail.iter().copied()).collect()
}

/// The core of a filter for the time of a step; refuses a step inside a step's callback.
pub fn lock<T>(core: &Mutex<T>) -> Outcome<MutexGuard<'_, T>> {
    match core.try_lock() {
        Ok(guard) => Ok(guard),
        Err(TryLockError::Poisoned(poisoned)) => Ok(poisoned.into_inner()),
        Err(TryLockError::WouldBlock) => Err(PyRuntimeError::new_err(
            "the filter is in the middle of a step; a callback or another thread may not start one",
        )
        .into()),
    }
}

/// A new reference to an attribute.
pub fn read(py: Python<'_>, attribute: &Mutex<Py<PyAny>>) -> Py<PyAny> {
    attribute.lock().unwrap_or_else(PoisonError::into_inner).clone_ref(py)
}

/// Replaces an attribute.
pub fn write(attribute: &Mutex<Py<PyAny>>, value: Py<PyAny>) {
    let old = std::mem::replace(&mut *attribute.lock().unwrap_or_else(PoisonError::into_inner), value);
    drop(old);
}

/// An entry of a pickled state.
pub fn entry<'py>(state: &Bound<'py, PyDict>, name: &str) -> Outcome<Bound<'py, PyAny>> {
    state.get_item(name)?.ok_or_else(|| Error::argument("state", format!("the entry {name:?}"), "none").into())
}
