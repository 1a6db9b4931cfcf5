//! Stops long work from another thread: Ctrl-C must not wait for the end of a fit.
//!
//! Work looks for the request before each task and between rounds ([`checkpoint`]). A stop unwinds the stack
//! without running the panic hook, so that no function on the way has to hand a result of "stopped" through,
//! and nothing is returned that is half computed.

use crate::error::{Error, Result};
use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The request to stop some work; clones share it.
#[derive(Debug, Clone, Default)]
pub struct Interrupt(Arc<AtomicBool>);

/// The payload of the unwinding.
struct Stopped;

thread_local! {
    /// The interrupt of the work that this thread does.
    static CURRENT: RefCell<Option<Interrupt>> = const { RefCell::new(None) };
}

impl Interrupt {
    /// Requests that the work stops.
    pub fn request(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Runs `work`, which stops at its next checkpoint after a request. Values that it was changing are then
    /// half changed.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if it was stopped.
    pub fn watch<R>(&self, work: impl FnOnce() -> R) -> Result<R> {
        let result = catch_unwind(AssertUnwindSafe(|| under(Some(self.clone()), work)));
        result.map_err(|payload| if payload.is::<Stopped>() { Error::Interrupted } else { resume_unwind(payload) })
    }
}

/// Ends the work of this thread here if that was requested; else does nothing.
#[inline]
pub fn checkpoint() {
    let is_requested = CURRENT.with_borrow(|current| current.as_ref().is_some_and(|i| i.0.load(Ordering::Relaxed)));
    if is_requested {
        resume_unwind(Box::new(Stopped));
    }
}

/// The interrupt of this thread's work, for threads that share it.
pub(super) fn current() -> Option<Interrupt> {
    CURRENT.with_borrow(Clone::clone)
}

/// Runs `work` as part of the work that `interrupt` stops.
pub(super) fn under<R>(interrupt: Option<Interrupt>, work: impl FnOnce() -> R) -> R {
    struct Restore(Option<Interrupt>);
    impl Drop for Restore {
        fn drop(&mut self) {
            CURRENT.set(self.0.take());
        }
    }
    let _restore = Restore(CURRENT.replace(interrupt));
    work()
}

#[cfg(test)]
mod tests {
    use super::super::{Threads, for_each_band, map};
    use super::*;
    use std::sync::atomic::AtomicUsize;

    #[test]
    fn bands_stop_on_any_number_of_threads() {
        for threads in [1, 3] {
            let threads = Threads::new(Some(threads)).unwrap();
            let (interrupt, done) = (Interrupt::default(), AtomicUsize::new(0));
            let mut rows = vec![0_u8; 64 * 1000];
            let result = interrupt.watch(|| {
                threads.install(|| {
                    for_each_band(&mut rows, 1, |_, _, _| {
                        interrupt.request();
                        done.fetch_add(1, Ordering::Relaxed);
                    });
                });
            });
            assert!(matches!(result, Err(Error::Interrupted)));
            // Bands that had begun on another thread end.
            assert!(done.into_inner() <= 3);
            // The pool is as good as before, and other work is not stopped.
            threads.install(|| for_each_band(&mut rows, 1, |_, _, band| band.fill(1)));
            assert!(rows.iter().all(|&value| value == 1));
        }
    }

    #[test]
    fn tasks_of_tasks_stop_on_any_number_of_threads() {
        for threads in [1, 3] {
            let threads = Threads::new(Some(threads)).unwrap();
            let (interrupt, done) = (Interrupt::default(), AtomicUsize::new(0));
            let inner = || {
                done.fetch_add(1, Ordering::Relaxed);
                interrupt.request();
            };
            let result = interrupt.watch(|| threads.install(|| map(0..50, |_| map(0..50, |_| inner()).len())));
            assert!(matches!(result, Err(Error::Interrupted)));
            // Tasks that had begun on another thread end.
            assert!(done.into_inner() <= 3);
        }
    }

    #[test]
    fn work_that_is_not_stopped_returns_its_value() {
        assert_eq!(
            Interrupt::default()
                .watch(|| {
                    checkpoint();
                    7
                })
                .unwrap(),
            7
        );
        checkpoint();
    }

    #[test]
    fn a_panic_stays_one() {
        let panicked = catch_unwind(|| Interrupt::default().watch(|| resume_unwind(Box::new("a panic"))));
        assert!(panicked.is_err_and(|payload| payload.is::<&str>()));
    }
}
