//! Memory that one estimate leaves for the next: fresh memory costs about as much time as the work done in
//! it.

use super::data_term::Pool;
use super::plane_pool::{MAX_KEPT_BYTES, PlanePool, lock};
use super::planes::Planes;
use super::pyramid::Pyramid;
use super::regularize::RegularizeScratch;
use crate::parallel::PerProcess;
use crate::simd::SimdReal;
use std::any::Any;
use std::sync::Mutex;

/// All the memory of one estimate.
#[derive(Debug, Default)]
pub(super) struct Workspace<T> {
    pub pyramid: Pyramid<T>,
    pub pool: Pool<T>,
    pub scratch: RegularizeScratch<T>,
    pub space: PlanePool<T>,
}

impl<T: SimdReal> Workspace<T> {
    /// Whether there is so much memory that results should not need theirs besides.
    pub fn is_large(&self) -> bool {
        self.bytes() > MAX_KEPT_BYTES
    }

    /// Lets go of what is free if there is so much memory that it matters more than the time to get it again.
    pub fn clear_if_large(&self) {
        if self.is_large() {
            self.clear();
        }
    }

    /// Lets go of what is free.
    pub fn clear(&self) {
        self.space.clear();
    }

    /// Gives what is free back to the system if there is so much memory that it matters more than the time to
    /// get it again: blocks of other sizes would not fit into it.
    pub fn release_to_system_if_large(&self) {
        if self.is_large() {
            self.clear();
            release_to_system();
        }
    }

    /// Gives all but what is `needed` back to the system. That takes time, since the next estimate has to ask
    /// for it again.
    pub fn release_to_system<'a>(&mut self, needed: impl Iterator<Item = &'a mut Planes<T>>) {
        *self = Self::default();
        needed.for_each(Planes::shrink);
        release_to_system();
    }

    fn bytes(&self) -> usize {
        (self.pyramid.samples() + self.space.room()) * size_of::<T>()
    }
}

/// Hands freed memory back to the system. The GNU allocator keeps blocks of up to 32 MiB for later, among
/// them most of ours, while results are too large to fit in.
fn release_to_system() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: takes no pointer, and may be called at any time from any thread.
    unsafe {
        libc::malloc_trim(0);
    }
}

/// The workspace of the estimator that was dropped last.
static LAST: PerProcess<Mutex<Option<Box<dyn Any + Send>>>> = PerProcess::new();

/// An estimator's workspaces: as many as it has had calls at a time.
#[derive(Debug, Default)]
pub(super) struct WorkspaceStore {
    free: Mutex<Vec<Box<dyn Any + Send>>>,
}

impl WorkspaceStore {
    /// A workspace, used before if possible.
    pub fn take<T: SimdReal>(&self) -> Box<Workspace<T>> {
        let own = lock(&self.free).pop();
        let any = own.or_else(|| lock(LAST.get()).take());
        any.and_then(|any| any.downcast().ok()).unwrap_or_default()
    }

    /// Keeps a workspace for later.
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
