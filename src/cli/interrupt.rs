//! Ctrl-C: the first stops the run after the current frame, the second ends the process at once. So does the
//! first one while inputs are opened, which a pipe may never end.

use crate::error::{Error, Result};
use crate::io::write::remove_temporaries;
use std::sync::Once;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Exit code of a process stopped by Ctrl-C (128 + SIGINT).
pub const EXIT_INTERRUPTED: i32 = 130;

static STOP_REQUESTED: AtomicBool = AtomicBool::new(false);
static RUNNING: AtomicUsize = AtomicUsize::new(0);
/// Whether a command has opened its inputs.
static HAS_INPUTS: AtomicBool = AtomicBool::new(false);

/// Held while a command runs: from [`start_work`] on, a signal sets a flag instead of ending the process.
#[derive(Debug)]
pub struct Watch(());

impl Watch {
    /// Installs the handler (once a process) and starts watching.
    pub fn begin() -> Self {
        static HANDLER: Once = Once::new();
        // Where a handler cannot be had (a host program has its own), Ctrl-C keeps its old meaning.
        HANDLER.call_once(|| drop(ctrlc::set_handler(on_signal)));
        if RUNNING.fetch_add(1, Ordering::SeqCst) == 0 {
            STOP_REQUESTED.store(false, Ordering::SeqCst);
            HAS_INPUTS.store(false, Ordering::SeqCst);
        }
        Self(())
    }

    /// Fails with [`Error::Interrupted`] once a signal has come.
    #[allow(clippy::unused_self)] // read only by who watches: else the flag is that of an earlier run
    pub fn check(&self) -> Result<()> {
        if STOP_REQUESTED.load(Ordering::SeqCst) { Err(Error::Interrupted) } else { Ok(()) }
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        RUNNING.fetch_sub(1, Ordering::SeqCst);
    }
}

/// Called once all inputs are open: there is something to finish now.
pub fn start_work() {
    HAS_INPUTS.store(true, Ordering::SeqCst);
}

fn on_signal() {
    let again = STOP_REQUESTED.swap(true, Ordering::SeqCst);
    if again || RUNNING.load(Ordering::SeqCst) == 0 || !HAS_INPUTS.load(Ordering::SeqCst) {
        let _no_new_ones = remove_temporaries();
        std::process::exit(EXIT_INTERRUPTED);
    }
}
