//! Memory of results and frames that Python let go of, kept for the next ones of the same size.
//!
//! A sequence asks for the same few large buffers again and again. Fresh ones cost a page fault every 4 KiB
//! and have to be initialised, on the calling thread, which together can take as long as a per-pixel
//! estimate. At most [`LIMIT`] bytes are kept, the newest.

use crate::parallel::PerProcess;
use std::any::Any;
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Most bytes kept.
const LIMIT: usize = 64 << 20;
/// Smaller buffers are left to the allocator, which is quick with them.
const LEAST: usize = 64 << 10;

/// Buffers with their size in bytes, oldest first.
#[derive(Default)]
struct Shelf {
    bytes: usize,
    buffers: VecDeque<(usize, Box<dyn Any + Send>)>,
}

static SHELF: PerProcess<Mutex<Shelf>> = PerProcess::new();

fn shelf() -> MutexGuard<'static, Shelf> {
    SHELF.get().lock().unwrap_or_else(PoisonError::into_inner)
}

/// A buffer of exactly `len` values, whatever they are, if there is one.
pub fn take<T: Send + 'static>(len: usize) -> Option<Vec<T>> {
    let mut shelf = shelf();
    let fits =
        |buffer: &(usize, Box<dyn Any + Send>)| buffer.1.downcast_ref::<Vec<T>>().is_some_and(|v| v.len() == len);
    let at = shelf.buffers.iter().rposition(fits)?;
    let (size, buffer) = shelf.buffers.remove(at)?;
    shelf.bytes -= size;
    Some(*buffer.downcast().ok()?)
}

/// Keeps a buffer for later.
pub fn give<T: Send + 'static>(buffer: Vec<T>) {
    let size = buffer.capacity() * size_of::<T>();
    if !(LEAST..=LIMIT).contains(&size) {
        return;
    }
    let mut shelf = shelf();
    shelf.bytes += size;
    shelf.buffers.push_back((size, Box::new(buffer)));
    while shelf.bytes > LIMIT {
        let Some((size, _)) = shelf.buffers.pop_front() else { break };
        shelf.bytes -= size;
    }
}

/// A copy of `values`, in a kept buffer where there is one.
pub fn copy<T: Copy + Send + 'static>(values: &[T]) -> Vec<T> {
    match take(values.len()) {
        Some(mut buffer) => {
            buffer.copy_from_slice(values);
            buffer
        }
        None => values.to_vec(),
    }
}
