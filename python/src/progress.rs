//! Progress of long work, which stops on Ctrl-C.

use crate::errors::Outcome;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

/// `progress`: None is silent, True draws a line on standard error, a function is called with (done, total).
pub struct Reporter<'py> {
    py: Python<'py>,
    callback: Option<Bound<'py, PyAny>>,
}

impl<'py> Reporter<'py> {
    /// Reads the option.
    pub fn new(py: Python<'py>, progress: Option<&Bound<'py, PyAny>>) -> Outcome<Self> {
        let callback = match progress {
            None => None,
            Some(value) if value.is_callable() => Some(value.clone()),
            Some(value) => match value.extract::<bool>() {
                Ok(true) => Some(py.import("jacoflow._progress")?.getattr("Line")?.call0()?),
                Ok(false) => None,
                Err(_) => {
                    let got = value.get_type();
                    let message = format!("progress: expected None, True or a function of (done, total), got {got}");
                    return Err(PyTypeError::new_err(message).into());
                }
            },
        };
        Ok(Self { py, callback })
    }

    /// `done` of `total` frames are finished. Raises KeyboardInterrupt when Ctrl-C was pressed, and what
    /// the function raises.
    pub fn step(&self, done: usize, total: usize) -> Outcome<()> {
        self.py.check_signals()?;
        if let Some(callback) = &self.callback {
            callback.call1((done, total))?;
        }
        Ok(())
    }
}
