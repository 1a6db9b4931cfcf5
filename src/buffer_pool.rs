//! Pool of large buffers: the memory of results and frames that are no longer used, kept for the next ones.
//!
//! A sequence needs the same few large buffers again and again. A fresh one costs a page fault every 4 KiB
//! and is initialised on the calling thread, which together can take as long as a per-pixel estimate.

use crate::parallel::PerProcess;
use std::any::Any;
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Maximum size of the pool, bytes; beyond it the oldest buffers are freed. A flow field of 1920 x 1080 px
/// with its covariance and its frames takes 240 MB.
const MAX_BYTES: usize = 256 << 20;
/// Minimum size of a pooled buffer, bytes: the allocator is quick with smaller ones.
const MIN_BUFFER_BYTES: usize = 64 << 10;

/// Buffers with their size in bytes, oldest first.
#[derive(Default)]
struct Pool {
    bytes: usize,
    buffers: VecDeque<(usize, Box<dyn Any + Send>)>,
}

static POOL: PerProcess<Mutex<Pool>> = PerProcess::new();

fn pool() -> MutexGuard<'static, Pool> {
    POOL.get().lock().unwrap_or_else(PoisonError::into_inner)
}

/// Takes a buffer of exactly `len` values, with unspecified content, if the pool has one.
pub fn take<T: Send + 'static>(len: usize) -> Option<Vec<T>> {
    let mut pool = pool();
    let fits =
        |buffer: &(usize, Box<dyn Any + Send>)| buffer.1.downcast_ref::<Vec<T>>().is_some_and(|v| v.len() == len);
    let at = pool.buffers.iter().rposition(fits)?;
    let (size, buffer) = pool.buffers.remove(at)?;
    pool.bytes -= size;
    Some(*buffer.downcast().ok()?)
}

/// Takes a buffer of `len` values; a new one is filled with `value`, a pooled one has unspecified content.
pub fn take_or<T: Clone + Send + 'static>(len: usize, value: T) -> Vec<T> {
    take(len).unwrap_or_else(|| vec![value; len])
}

/// Returns a buffer to the pool.
pub fn give<T: Send + 'static>(buffer: Vec<T>) {
    let size = buffer.capacity() * size_of::<T>();
    if !(MIN_BUFFER_BYTES..=MAX_BYTES).contains(&size) {
        return;
    }
    let mut pool = pool();
    pool.bytes += size;
    pool.buffers.push_back((size, Box::new(buffer)));
    while pool.bytes > MAX_BYTES {
        let Some((size, _)) = pool.buffers.pop_front() else { break };
        pool.bytes -= size;
    }
}

/// Copies `values` into a pooled buffer, or into a new one.
pub fn copy<T: Copy + Send + 'static>(values: &[T]) -> Vec<T> {
    match take(values.len()) {
        Some(mut buffer) => {
            buffer.copy_from_slice(values);
            buffer
        }
        None => values.to_vec(),
    }
}
