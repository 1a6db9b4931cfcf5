//! The command line, as `python -m jacoflow` calls it.

use crate::errors::Outcome;
use pyo3::prelude::*;
use std::ffi::OsString;

/// Runs the command line with `arguments` (the program's name first) and returns the exit code.
#[pyfunction(name = "_run_command_line")]
pub fn run_command_line(py: Python<'_>, arguments: Vec<OsString>) -> Outcome<i32> {
    let code = py.detach(|| jacoflow::cli::run(arguments));
    restore_signals(py)?;
    Ok(code)
}

/// Gives the signals that the command line watches back to the interpreter, which goes on.
fn restore_signals(py: Python<'_>) -> Outcome<()> {
    let signals = py.import("signal")?;
    for name in ["SIGINT", "SIGTERM"] {
        let number = signals.getattr(name)?;
        let handler = signals.call_method1("getsignal", (&number,))?;
        // Only the main thread may, and only it has them.
        if !handler.is_none() && signals.call_method1("signal", (&number, handler)).is_err() {
            break;
        }
    }
    Ok(())
}
