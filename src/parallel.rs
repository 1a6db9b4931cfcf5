//! Threads: fixed row bands, so that results are bit-identical for any number of threads.

mod interrupt;
mod tasks;

pub use interrupt::{Interrupt, checkpoint};
pub(crate) use tasks::{for_each, for_each_value, join, map, map_range, thread_count};

use crate::error::{Error, Result};
use interrupt::{current, under};
use std::ffi::OsString;
use std::sync::atomic::{AtomicPtr, Ordering};
use std::sync::{Arc, Mutex};

/// Rows of one task. Fixed, so that the split never depends on the number of threads.
pub const BAND_ROWS: usize = 16;

/// Largest buffer, values, that is worked on by the caller's thread: waking a pool takes longer.
const MAX_SERIAL: usize = 1 << 16;

/// The environment variable that sets the number of threads.
const VARIABLE: &str = "JACOFLOW_THREADS";

/// Maximum number of threads for each processor.
pub const MAX_PER_PROCESSOR: usize = 4;

/// How many threads a computation may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Threads(Option<usize>);

impl Threads {
    /// `None`: the number in the environment variable `JACOFLOW_THREADS`; where that is unset or empty, every
    /// processor.
    ///
    /// # Errors
    /// [`Error::Argument`] for zero, or naming `JACOFLOW_THREADS` where that decides and is no positive
    /// number.
    pub fn new(count: Option<usize>) -> Result<Self> {
        if count == Some(0) {
            return Err(Error::argument("threads", "a positive integer", 0));
        }
        Self(count).check()
    }

    /// Checks the environment variable where it decides: a mistake there must not go unnoticed.
    ///
    /// # Errors
    /// As [`Threads::new`].
    pub fn check(self) -> Result<Self> {
        if self.0.is_none() {
            from_environment(std::env::var_os(VARIABLE))?;
        }
        Ok(self)
    }

    /// The number of threads this resolves to, at most [`MAX_PER_PROCESSOR`] for each processor.
    ///
    /// More would only cost memory, and thousands can bring a machine to its knees.
    pub fn count(self) -> usize {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        self.0
            .or_else(|| from_environment(std::env::var_os(VARIABLE)).ok()?)
            .map_or(processors, |requested| requested.min(MAX_PER_PROCESSOR * processors))
    }

    /// Runs `work`, whose tasks exactly this many threads share.
    pub fn install<R: Send>(self, work: impl FnOnce() -> R + Send) -> R {
        let (mut work, mut result) = (Some(work), None);
        install(self.count(), &mut || result = work.take().map(|work| work()));
        result.expect("the pool has run the work")
    }
}

/// The number of threads in the value of [`VARIABLE`]; `None` when it is unset or empty.
fn from_environment(value: Option<OsString>) -> Result<Option<usize>> {
    let Some(value) = value.filter(|value| !value.is_empty()) else { return Ok(None) };
    let number = value.to_str().and_then(|text| text.trim().parse().ok()).filter(|&n: &usize| n > 0);
    number.map(Some).ok_or_else(|| Error::argument(VARIABLE, "a positive integer", value.display()))
}

/// Behind a pointer, as rayon would compile all that is done inside several times over.
fn install(threads: usize, work: &mut (dyn FnMut() + Send)) {
    let interrupt = current();
    pool(threads).install(|| under(interrupt, work));
}

/// The shared pool of `count` threads; made on first use and kept.
///
/// Nothing here may use rayon's global pool: a forked process cannot replace it.
fn pool(count: usize) -> Arc<rayon::ThreadPool> {
    type Pools = Vec<(usize, Arc<rayon::ThreadPool>)>;
    static POOLS: PerProcess<Mutex<Pools>> = PerProcess::new();
    let mut pools = POOLS.get().lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if let Some((_, pool)) = pools.iter().find(|(n, _)| *n == count) {
        return Arc::clone(pool);
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(count)
        .thread_name(|i| format!("jacoflow-{i}"))
        .build()
        .map(Arc::new)
        .expect("the operating system starts threads");
    pools.push((count, Arc::clone(&pool)));
    pool
}

/// A static value that a forked process makes for itself instead of inheriting it.
///
/// Of all threads only the one that called `fork` lives on in the child. A pool there has no threads, and a
/// lock that another thread held is never released. So the parent's value is left alone, never locked and
/// never dropped, at the price of its memory.
pub(crate) struct PerProcess<T>(AtomicPtr<Owned<T>>);

struct Owned<T> {
    process: u32,
    value: T,
}

impl<T: Default + Send + Sync> PerProcess<T> {
    /// For a static: the value itself is made on first use.
    pub const fn new() -> Self {
        Self(AtomicPtr::new(std::ptr::null_mut()))
    }

    /// This process's value.
    pub fn get(&'static self) -> &'static T {
        let process = std::process::id();
        let known = self.0.load(Ordering::Acquire);
        // SAFETY: null, or leaked below and never freed; its fields are not written to again.
        let own = unsafe { known.as_ref() }.filter(|owned| owned.process == process);
        // No lock: nobody would be left to release it.
        &own.unwrap_or_else(|| self.begin(known, process)).value
    }

    #[cold]
    fn begin(&'static self, known: *mut Owned<T>, process: u32) -> &'static Owned<T> {
        let fresh = Box::into_raw(Box::new(Owned { process, value: T::default() }));
        match self.0.compare_exchange(known, fresh, Ordering::AcqRel, Ordering::Acquire) {
            // SAFETY: made above, and leaked by being stored.
            Ok(_) => unsafe { &*fresh },
            Err(quicker) => {
                // SAFETY: made above, and seen by nobody else.
                drop(unsafe { Box::from_raw(fresh) });
                // SAFETY: another thread of this process stored it, and it is never freed.
                unsafe { &*quicker }
            }
        }
    }
}

/// Calls `work(band, rows, band_slice)` for every band of [`BAND_ROWS`] rows of a row-major buffer with
/// `row_len` values a row.
///
/// Call it inside [`Threads::install`]; outside, small buffers are worked on by the caller.
pub fn for_each_band<T: Send>(
    buffer: &mut [T],
    row_len: usize,
    work: impl Fn(usize, std::ops::Range<usize>, &mut [T]) + Sync,
) {
    for_each_band_of(BAND_ROWS, buffer, row_len, work);
}

/// As [`for_each_band`], for work whose bands need more rows than [`BAND_ROWS`] to be worth their overlap.
///
/// `band_rows` must be a constant: were it to depend on the number of threads, so would the results.
pub(crate) fn for_each_band_of<T: Send>(
    band_rows: usize,
    buffer: &mut [T],
    row_len: usize,
    work: impl Fn(usize, std::ops::Range<usize>, &mut [T]) + Sync,
) {
    in_bands(band_rows, buffer, row_len, &work);
}

/// Work on a band of rows: its number, the rows and their values.
type BandWork<'a, T> = dyn Fn(usize, std::ops::Range<usize>, &mut [T]) + Sync + 'a;

/// Behind a pointer, so that it is compiled once for each type of value.
fn in_bands<T: Send>(band_rows: usize, buffer: &mut [T], row_len: usize, work: &BandWork<'_, T>) {
    if row_len == 0 {
        return;
    }
    let rows = buffer.len() / row_len;
    let one_band = |(band, slice): (usize, &mut [T])| {
        let start = band * band_rows;
        work(band, start..(start + band_rows).min(rows), slice);
    };
    let is_serial = tasks::is_outside() && buffer.len() <= MAX_SERIAL;
    let bands = buffer.chunks_mut(band_rows * row_len).enumerate();
    if !is_serial {
        return for_each(bands, one_band);
    }
    for band in bands {
        checkpoint();
        one_band(band);
    }
}

/// Receives the progress of long work; may stop it.
///
/// The binary draws a bar, the Python binding looks for signals.
pub trait Progress: Sync {
    /// `done` of `total` steps (0: unknown) are finished.
    ///
    /// # Errors
    /// [`Error::Interrupted`] (or any other) makes the caller stop and clean up.
    fn step(&self, done: usize, total: usize) -> Result<()>;
}

/// Reports nothing and never stops.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn step(&self, _done: usize, _total: usize) -> Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_buffers_outside_every_pool_stay_out_of_the_global_one() {
        let mut named = vec![false; 2 * MAX_SERIAL];
        let own = |name: &str| name.starts_with("jacoflow-");
        for_each_band(&mut named, MAX_SERIAL / 16, |_, _, band| {
            band.fill(std::thread::current().name().is_some_and(own));
        });
        assert!(named.iter().all(|&named| named));
    }

    #[test]
    fn a_value_of_a_process_is_one_for_all_its_threads() {
        static VALUE: PerProcess<Mutex<usize>> = PerProcess::new();
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| *VALUE.get().lock().unwrap() += 1);
            }
        });
        assert_eq!(*VALUE.get().lock().unwrap(), 8);
    }

    #[test]
    fn a_value_of_another_process_is_left_alone() {
        static VALUE: PerProcess<Mutex<usize>> = PerProcess::new();
        let parents = Box::new(Owned { process: std::process::id().wrapping_add(1), value: Mutex::new(3) });
        VALUE.0.store(Box::into_raw(parents), Ordering::Release);
        // SAFETY: stored above and never freed.
        let held = unsafe { &*VALUE.0.load(Ordering::Acquire) }.value.lock().unwrap();
        assert_eq!(*VALUE.get().lock().unwrap(), 0);
        assert_eq!(*held, 3);
    }
}
