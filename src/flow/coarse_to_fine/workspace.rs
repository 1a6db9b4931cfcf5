//! Memory that one estimate leaves for the next.

use super::data_term::Pool;
use super::plane_pool::{MAX_KEPT_BYTES, PlanePool, lock};
use super::planes::Planes;
use super::pyramid::Pyramid;
use super::regularize::RegularizeScratch;
use crate::parallel::PerProcess;
use crate::simd::SimdReal;
use std::any::Any;
use std::sync::Mutex;

#[derive(Debug, Default)]
pub(super) struct Workspace<T> {
    pub pyramid: Pyramid<T>,
    pub pool: Pool<T>,
    pub scratch: RegularizeScratch<T>,
    pub space: PlanePool<T>,
}

impl<T: SimdReal> Workspace<T> {
    /// Whether there is so much memory that results should not need theirs in addition.
    pub fn is_large(&self) -> bool {
        self.bytes() > MAX_KEPT_BYTES
    }

    pub fn clear_if_large(&self) {
        if self.is_large() {
            self.clear();
        }
    }

    pub fn clear(&self) {
        self.space.clear();
    }

    /// Returns unused planes of a large workspace to the system: later blocks have other sizes.
    pub fn release_to_system_if_large(&self) {
        if self.is_large() {
            self.clear();
            release_to_system();
        }
    }

    /// Returns everything but the `needed` planes to the system; the next estimate allocates anew.
    pub fn release_to_system<'a>(&mut self, needed: impl Iterator<Item = &'a mut Planes<T>>) {
        *self = Self::default();
        needed.for_each(Planes::shrink);
        release_to_system();
    }

    fn bytes(&self) -> usize {
        (self.pyramid.samples() + self.space.room()) * size_of::<T>()
    }
}

/// Returns freed memory to the system: the GNU allocator keeps blocks of up to 32 MiB, most of ours.
fn release_to_system() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: takes no pointer, and may be called at any time from any thread.
    unsafe {
        libc::malloc_trim(0);
    }
}

/// The workspace of the last estimator that was dropped.
static LAST: PerProcess<Mutex<Option<Box<dyn Any + Send>>>> = PerProcess::new();

/// Workspaces of an estimator, one for each concurrent call so far.
#[derive(Debug, Default)]
pub(super) struct WorkspaceStore {
    free: Mutex<Vec<Box<dyn Any + Send>>>,
}

impl WorkspaceStore {
    /// A workspace, reused if possible.
    pub fn take<T: SimdReal>(&self) -> Box<Workspace<T>> {
        let own = lock(&self.free).pop();
        let any = own.or_else(|| lock(LAST.get()).take());
        any.and_then(|any| any.downcast().ok()).unwrap_or_default()
    }

    pub fn put_back<T: SimdReal>(&self, workspace: Box<Workspace<T>>) {
        lock(&self.free).push(workspace);
    }
}

impl Drop for WorkspaceStore {
    fn drop(&mut self) {
        let Some(any) = lock(&self.free).pop() else { return };
        let bytes = any.downcast_ref::<Workspace<f32>>().map(Workspace::bytes);
        let bytes = bytes.or_else(|| any.downcast_ref::<Workspace<f64>>().map(Workspace::bytes));
        if bytes.is_some_and(|bytes| bytes <= MAX_KEPT_BYTES) {
            *lock(LAST.get()) = Some(any);
        }
    }
}
