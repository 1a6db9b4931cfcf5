//! One place where core errors become Python exceptions.

use jacoflow::error::Error;
use numpy::{AsSliceError, BorrowError};
use pyo3::exceptions::{PyException, PyKeyboardInterrupt, PyMemoryError, PyOSError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::{CastError, CastIntoError, create_exception};

create_exception!(
    jacoflow,
    JacoflowError,
    PyException,
    "Base class of the errors that are jacoflow's own (bad arguments are ValueError or TypeError, files OSError)."
);
create_exception!(jacoflow, FormatError, JacoflowError, "A file's content is not what its format demands.");
create_exception!(
    jacoflow,
    NotObservableError,
    JacoflowError,
    "The combination asked for cannot be determined from brightness, whatever the frames show."
);
create_exception!(jacoflow, NumericalError, JacoflowError, "A computation lost its numerical footing.");
create_exception!(
    jacoflow,
    MissingDependencyError,
    JacoflowError,
    "A program or optional package that the request needs is not installed."
);

/// An exception to raise: an error of the library, or one of the interpreter's. Neither type is of this
/// crate, so that one cannot be converted into the other without a third.
#[derive(Debug)]
pub struct Raised(PyErr);

/// What a function called by Python returns.
pub type Outcome<T> = std::result::Result<T, Raised>;

macro_rules! raised_from {
    ($($error:ty),*) => {$(
        impl From<$error> for Raised {
            fn from(error: $error) -> Self {
                Self(error.into())
            }
        }
    )*};
}
raised_from!(PyErr, CastError<'_, '_>, CastIntoError<'_>, BorrowError, AsSliceError);

impl From<Raised> for PyErr {
    fn from(raised: Raised) -> Self {
        raised.0
    }
}

impl From<Error> for Raised {
    fn from(error: Error) -> Self {
        let message = error.to_string();
        Self(match error {
            Error::Argument { .. } => PyValueError::new_err(message),
            Error::Type { .. } => PyTypeError::new_err(message),
            Error::Io { path, source } => {
                let code = source.raw_os_error().unwrap_or_else(|| errno(source.kind()));
                // A plain string, as in Python's own errors: their text shows it with repr().
                PyOSError::new_err((code, describe(&source), path.into_os_string()))
            }
            Error::Format { .. } => FormatError::new_err(message),
            Error::NotObservable(_) => NotObservableError::new_err(message),
            Error::Numerical(_) => NumericalError::new_err(message),
            Error::Missing(_) => MissingDependencyError::new_err(message),
            Error::Memory(_) => PyMemoryError::new_err(message),
            Error::Interrupted => PyKeyboardInterrupt::new_err(()),
        })
    }
}

/// The system's words without Rust's trailing `(os error N)`, which Python prints itself.
fn describe(source: &std::io::Error) -> String {
    let text = source.to_string();
    text.split(" (os error").next().unwrap_or(&text).to_owned()
}

/// The POSIX code of an error made by a library instead of the system: it picks the `OSError` subclass.
fn errno(kind: std::io::ErrorKind) -> i32 {
    use std::io::ErrorKind;
    match kind {
        ErrorKind::NotFound => 2,
        ErrorKind::PermissionDenied => 13,
        ErrorKind::AlreadyExists => 17,
        ErrorKind::IsADirectory => 21,
        ErrorKind::NotADirectory => 20,
        ErrorKind::BrokenPipe => 32,
        _ => 5,
    }
}
