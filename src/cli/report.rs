//! How a command ends: errors on standard error, one JSON object on standard output, the exit code.

use super::interrupt::EXIT_INTERRUPTED;
use crate::error::{Error, Result};
use serde_json::{Value, json};
use std::io::Write;

/// Result of a command: its summary, and the error that ended it.
#[derive(Debug, Default)]
pub struct Report {
    /// The machine-readable summary.
    pub summary: Value,
    /// The error that ended the run early, with the summary of what was done until then.
    pub failure: Option<Error>,
}

/// Prints what the command left to say and returns the exit code.
pub fn finish(result: Result<Report>, json: bool) -> i32 {
    let (mut summary, failure) = match result {
        Ok(report) => (report.summary, report.failure),
        Err(error) => (json!({}), Some(error)),
    };
    if failure.as_ref().is_some_and(is_broken_pipe) {
        // The reader of our output has seen enough; that is its right, not our failure.
        return 0;
    }
    let code = failure.as_ref().map_or(0, exit_code);
    if let Some(error) = &failure {
        print_message(&format!("error: {error}"));
    }
    if json {
        if let (Some(object), Some(error)) = (summary.as_object_mut(), &failure) {
            object.insert("error".into(), error.to_string().into());
        }
        if let Some(object) = summary.as_object_mut() {
            object.insert("exit_code".into(), code.into());
        }
        if let Err(error) = print(&format!("{summary}\n"))
            && !is_broken_pipe(&error)
        {
            print_message(&format!("error: {error}"));
            return 1;
        }
    }
    code
}

/// The exit code that an error ends the process with.
fn exit_code(error: &Error) -> i32 {
    match error {
        Error::Argument { .. } | Error::Type { .. } | Error::NotObservable(_) => 2,
        Error::Missing(_) => 3,
        Error::Interrupted => EXIT_INTERRUPTED,
        _ => 1,
    }
}

fn is_broken_pipe(error: &Error) -> bool {
    matches!(error, Error::Io { source, .. } if source.kind() == std::io::ErrorKind::BrokenPipe)
}

/// Writes `text` to standard output.
pub fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(|source| Error::io("standard output", source))
}

/// Writes a line to standard error. When nobody can read it, nobody needs it.
pub fn print_message(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}
