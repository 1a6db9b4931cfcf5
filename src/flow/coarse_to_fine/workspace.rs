//! Memory that one estimate leaves for the next.

use super::data_term::Pool;
use super::plane_pool::{PlanePool, lock};
use super::pyramid::Pyramid;
use super::regularize::RegularizeScratch;
use crate::parallel::PerProcess;
use crate::simd::SimdReal;
use std::any::Any;
use std::sync::Mutex;

#[derive(Debug, Default)]
pub(super) struct Workspace<T> {
    /// Size of the frames, px.
    size: (usize, usize),
    pub pyramid: Pyramid<T>,
    pub pool: Pool<T>,
    pub scratch: RegularizeScratch<T>,
    pub space: PlanePool<T>,
}

impl<T: SimdReal> Workspace<T> {
    fn bytes(&self) -> usize {
        (self.pyramid.samples() + self.space.room()) * size_of::<T>()
    }
}

/// Maximum size, bytes, of a workspace that is kept after its estimator: that of frames of 1920 x 1080 px.
const MAX_KEPT_BYTES: usize = 640 << 20;

/// The workspace of the last estimator that was dropped.
static LAST: PerProcess<Mutex<Option<Box<dyn Any + Send>>>> = PerProcess::new();

/// Workspaces of an estimator, one for each concurrent call so far.
#[derive(Debug, Default)]
pub(super) struct WorkspaceStore {
    free: Mutex<Vec<Box<dyn Any + Send>>>,
}

impl WorkspaceStore {
    /// A workspace for frames of `size` px, reused if possible: others have blocks of other sizes.
    pub fn take<T: SimdReal>(&self, size: (usize, usize)) -> Box<Workspace<T>> {
        let own = lock(&self.free).pop();
        let any = own.or_else(|| lock(LAST.get()).take());
        let known = any.and_then(|any| any.downcast::<Workspace<T>>().ok());
        known.filter(|known| known.size == size).unwrap_or_else(|| Box::new(Workspace { size, ..Workspace::default() }))
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
