//! The one error type of the crate.
//!
//! Errors stay data until the edge: the binary prints them, the Python binding maps each variant to
//! one exception class. Every message names the argument, what was expected and what came.

use std::fmt;
use std::path::{Path, PathBuf};

/// What can go wrong, by what the caller has to change.
#[derive(Debug)]
pub enum Error {
    /// An argument has an unusable value, shape or combination (Python: `ValueError`).
    Argument {
        /// Name of the argument as the user wrote it.
        argument: &'static str,
        /// What would have been accepted.
        expected: String,
        /// What came instead.
        got: String,
    },
    /// An argument has an unusable type (Python: `TypeError`).
    Type {
        /// Name of the argument as the user wrote it.
        argument: &'static str,
        /// What would have been accepted.
        expected: String,
        /// What came instead.
        got: String,
    },
    /// The operating system refused a file operation (Python: `OSError`).
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's message.
        source: std::io::Error,
    },
    /// A file's content is not what its format demands (Python: `jacoflow.FormatError`).
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong with it and what would be right.
        message: String,
    },
    /// A combination that theory rules out (Python: `jacoflow.NotObservableError`).
    NotObservable(String),
    /// A computation lost its numerical footing (Python: `jacoflow.NumericalError`).
    Numerical(String),
    /// A program or optional part that is not there (Python: `jacoflow.MissingDependencyError`).
    Missing(String),
    /// Memory does not suffice for what an argument requests (Python: `MemoryError`).
    Memory(String),
    /// The user stopped the work (Ctrl-C; Python: `KeyboardInterrupt`).
    Interrupted,
}

// Written out: a macro for it would be the only reason why users of the filters compile a parser of Rust.
impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Argument { argument, expected, got } | Self::Type { argument, expected, got } => {
                write!(f, "{argument}: expected {expected}, got {got}")
            }
            Self::Io { path, source } => write!(f, "{}: {source}", path.display()),
            Self::Format { path, message } => write!(f, "{}: {message}", path.display()),
            Self::NotObservable(reason) => write!(f, "not observable: {reason}"),
            Self::Numerical(reason) => write!(f, "numerical failure: {reason}"),
            Self::Missing(what) | Self::Memory(what) => f.write_str(what),
            Self::Interrupted => f.write_str("interrupted"),
        }
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Io { source, .. } => Some(source),
            _ => None,
        }
    }
}

/// Shorthand for results of this crate.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An unusable value: `argument: expected ..., got ...`.
    pub fn argument(argument: &'static str, expected: impl Into<String>, got: impl std::fmt::Display) -> Self {
        Self::Argument { argument, expected: expected.into(), got: shortened(got.to_string()) }
    }

    /// An argument of a wrong shape.
    pub fn shape(argument: &'static str, expected: &[usize], got: &[usize]) -> Self {
        let [expected, got] = [expected, got].map(|axes| format!("shape {}", shape_text(axes)));
        Self::argument(argument, expected, got)
    }

    /// The same error about an argument of another name.
    pub(crate) fn about(self, argument: &'static str) -> Self {
        match self {
            Self::Argument { expected, got, .. } => Self::Argument { argument, expected, got },
            other => other,
        }
    }

    /// An argument whose values, `bytes` of them, do not fit into memory.
    pub fn memory(argument: &str, bytes: Option<usize>) -> Self {
        let size = bytes.map_or("more than the address space".into(), |bytes| format!("{bytes} bytes"));
        Self::Memory(format!("{argument}: expected what fits into memory, got {size}"))
    }

    /// A failed file operation on `path`.
    pub fn io(path: impl AsRef<Path>, source: std::io::Error) -> Self {
        Self::Io { path: path.as_ref().to_path_buf(), source }
    }

    /// A file whose content breaks its format.
    pub fn format(path: impl AsRef<Path>, message: impl Into<String>) -> Self {
        Self::Format { path: path.as_ref().to_path_buf(), message: message.into() }
    }
}

/// Refuses an argument that requests more memory than can be had: where an allocation fails, the process
/// ends.
///
/// `bytes`: what its largest buffer takes; `None`: more than an address can count.
///
/// # Errors
/// [`Error::Memory`] naming `argument`.
pub fn check_memory(argument: &str, bytes: Option<usize>) -> Result<()> {
    match bytes.map(|bytes| Vec::<u8>::new().try_reserve_exact(bytes)) {
        Some(Ok(())) => Ok(()),
        _ => Err(Error::memory(argument, bytes)),
    }
}

/// A number in a message: as it is, or with an exponent where that is shorter.
pub(crate) fn number(value: f64) -> String {
    let plain = value == 0.0 || !value.is_finite() || (1e-4..1e7).contains(&value.abs());
    if plain { value.to_string() } else { format!("{value:e}") }
}

/// Numbers in a message: `(1, 2.5, 3e300)`.
pub(crate) fn numbers<'a>(values: impl IntoIterator<Item = &'a f64>) -> String {
    let words: Vec<String> = values.into_iter().map(|&value| number(value)).collect();
    format!("({})", words.join(", "))
}

/// A shape in a message, as Python writes it: `(2, 48, 64)`, `(3,)`.
pub fn shape_text(axes: &[usize]) -> String {
    let words: Vec<String> = axes.iter().map(usize::to_string).collect();
    format!("({}{})", words.join(", "), if axes.len() == 1 { "," } else { "" })
}

/// Cuts values of hundreds of digits: their beginning says as much.
fn shortened(text: String) -> String {
    const MAX_LENGTH: usize = 160;
    // More digits than a number has: zeros before or behind them.
    const DIGITS: usize = 24;
    if text.len() > DIGITS
        && let Ok(value) = text.parse()
    {
        return number(value);
    }
    match text.char_indices().nth(MAX_LENGTH) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn huge_and_tiny_numbers_have_an_exponent() {
        for (value, word) in [(1e300, "1e300"), (-2.5e-300, "-2.5e-300"), (0.1, "0.1"), (f64::NAN, "NaN")] {
            assert_eq!(
                Error::argument("sigma", "less", value).to_string(),
                format!("sigma: expected less, got {word}")
            );
        }
        assert_eq!([&[][..], &[3], &[2, 48, 64]].map(shape_text), ["()", "(3,)", "(2, 48, 64)"]);
        assert_eq!(numbers(&[0.0, -1.5, 1e300, 1e-9]), "(0, -1.5, 1e300, 1e-9)");
    }
}
