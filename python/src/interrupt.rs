//! Ctrl-C during long work: the main thread looks for signals while another one works.

use crate::errors::Outcome;
use jacoflow::error::{Error, Result};
use jacoflow::parallel::Interrupt;
use pyo3::PyClass;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::pyclass::boolean_struct::False;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

/// Time between two looks for signals.
const PERIOD: Duration = Duration::from_millis(20);
/// Stack of the thread that works, bytes: that of a main thread.
const STACK: usize = 8 << 20;

/// Computes without the interpreter; Ctrl-C stops it at its next checkpoint, and raises KeyboardInterrupt.
pub fn interruptible<R: Send>(py: Python<'_>, work: impl FnOnce() -> Result<R> + Send) -> Outcome<R> {
    if !gets_signals(py)? {
        return Ok(py.detach(work)?);
    }
    let interrupt = Interrupt::default();
    let watched = interrupt.clone();
    thread::scope(|scope| {
        let (sender, results) = channel();
        let helper = thread::Builder::new().stack_size(STACK).spawn_scoped(scope, move || {
            let result = watched.watch(work);
            // Nobody waits for the result of work that was stopped.
            let _ = sender.send(result);
        });
        let helper = helper.map_err(|error| Error::io("thread", error))?;
        let result = wait(py, results);
        if result.is_err() {
            interrupt.request();
        }
        let ended = py.detach(|| helper.join());
        match (result, ended) {
            (Err(raised), _) => Err(raised),
            (Ok(_), Err(payload)) => std::panic::resume_unwind(payload),
            (Ok(result), Ok(())) => Ok(result.expect("a result is sent at the end")??),
        }
    })
}

/// Waits for the system without the interpreter (a pipe that nobody writes to); Ctrl-C leaves it waiting, and
/// raises KeyboardInterrupt.
pub fn abandonable<R: Send + 'static>(py: Python<'_>, work: impl FnOnce() -> Result<R> + Send + 'static) -> Outcome<R> {
    if !gets_signals(py)? {
        return Ok(py.detach(work)?);
    }
    let (sender, results) = channel();
    let helper = thread::Builder::new().stack_size(STACK).spawn(move || {
        // Nobody waits for what was abandoned.
        let _ = sender.send(work());
    });
    let helper = helper.map_err(|error| Error::io("thread", error))?;
    let result = wait(py, results)?;
    if let Err(payload) = py.detach(|| helper.join()) {
        std::panic::resume_unwind(payload);
    }
    Ok(result.expect("a result is sent at the end")?)
}

/// The result, if the thread that sends it does not panic; an error if a signal handler raised one.
fn wait<R: Send>(py: Python<'_>, mut results: Receiver<R>) -> Outcome<Option<R>> {
    loop {
        let waiting = &mut results;
        match py.detach(move || waiting.recv_timeout(PERIOD)) {
            Ok(result) => return Ok(Some(result)),
            Err(RecvTimeoutError::Disconnected) => return Ok(None),
            Err(RecvTimeoutError::Timeout) => py.check_signals()?,
        }
    }
}

/// Whether this thread is the one whose signal handlers run.
fn gets_signals(py: Python<'_>) -> Outcome<bool> {
    let threading = py.import("threading")?;
    let (this, main) = (threading.call_method0("current_thread")?, threading.call_method0("main_thread")?);
    Ok(this.is(&main))
}

/// The object for one thread: another one that works with it is an error, as the order of frames would be
/// lost.
pub fn alone<'py, T: PyClass<Frozen = False>>(object: &Bound<'py, T>) -> Outcome<PyRefMut<'py, T>> {
    object.try_borrow_mut().map_err(|_| {
        let class = object.as_any().get_type().name().map_or_else(|_| "object".into(), |name| name.to_string());
        let message =
            format!("{class}: expected one thread, got a call while another thread works with it; make one for each");
        PyRuntimeError::new_err(message).into()
    })
}

/// A value that long work changes. Work that Ctrl-C stopped in the middle leaves it half changed: then it is
/// dropped, and every later use refused.
pub struct Held<T>(Mutex<Option<T>>);

impl<T: Send> Held<T> {
    /// Holds a value.
    pub fn new(value: T) -> Self {
        Self(Mutex::new(Some(value)))
    }

    /// Reads or changes the value, without the interpreter: another thread may hold it.
    pub fn with<R: Send>(&self, py: Python<'_>, work: impl FnOnce(&mut T) -> R + Send) -> Outcome<R> {
        Ok(py.detach(|| self.locked(work))?)
    }

    /// The same for long work, which Ctrl-C stops.
    pub fn change<R: Send>(&self, py: Python<'_>, work: impl FnOnce(&mut T) -> Result<R> + Send) -> Outcome<R> {
        interruptible(py, || self.locked(work)?)
    }

    fn locked<R>(&self, work: impl FnOnce(&mut T) -> R) -> Result<R> {
        let mut place = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let wanted = "a tracker whose last step was completed";
        let mut value = place.take().ok_or_else(|| Error::argument("self", wanted, "one that was stopped in it"))?;
        let result = work(&mut value);
        *place = Some(value);
        Ok(result)
    }
}
