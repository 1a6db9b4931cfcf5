//! The command line, as `python -m jacoflow` calls it.

use pyo3::prelude::*;

/// Runs the command line with `arguments` (the program's name first) and returns the exit code.
#[pyfunction(name = "_run_command_line")]
pub fn run_command_line(py: Python<'_>, arguments: Vec<String>) -> i32 {
    let _ = (py, arguments);
    0
}
