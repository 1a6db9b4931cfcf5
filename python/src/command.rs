//! The command line, as `python -m jacoflow` calls it.

use pyo3::prelude::*;
use std::ffi::OsString;

/// Runs the command line with `arguments` (the program's name first) and returns the exit code.
#[pyfunction(name = "_run_command_line")]
pub fn run_command_line(py: Python<'_>, arguments: Vec<OsString>) -> i32 {
    py.detach(|| jacoflow::cli::run(arguments))
}
