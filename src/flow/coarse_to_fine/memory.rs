//! Memory that one estimate leaves for the next: fresh memory costs about as much time as the work done in
//! it.

use super::couple::CoupleScratch;
use super::data::Pool;
use super::grid::Planes;
use super::levels::Pyramid;
use crate::parallel::PerProcess;
use crate::simd::SimdReal;
use std::any::Any;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Planes that are free at the moment.
#[derive(Debug, Default)]
pub(super) struct Space<T> {
    free: Mutex<Vec<Planes<T>>>,
}

impl<T: SimdReal> Space<T> {
    /// Planes with any finite content: the smallest free ones with room enough, else the largest, which grow.
    pub fn planes(&self, width: usize, height: usize, count: usize) -> Planes<T> {
        let len = Planes::<T>::len(width, height, count);
        let mut free = lock(&self.free);
        let fit =
            |planes: &Planes<T>| if planes.room() < len { (1, usize::MAX - planes.room()) } else { (0, planes.room()) };
        let best = (0..free.len()).min_by_key(|&at| fit(&free[at]));
        let mut planes = best.map(|at| free.swap_remove(at)).unwrap_or_default();
        planes.reshape(width, height, count);
        planes
    }

    /// Takes planes back.
    pub fn keep(&self, planes: Planes<T>) {
        if planes.room() > 0 {
            lock(&self.free).push(planes);
        }
    }

    /// Takes planes back that are most of an estimate's memory: of large frames they are let go of, since
    /// what comes next needs the memory.
    pub fn keep_small(&self, planes: Planes<T>) {
        if planes.room() * size_of::<T>() <= LIMIT / 4 {
            self.keep(planes);
        }
    }

    /// Samples that are free.
    fn room(&self) -> usize {
        lock(&self.free).iter().map(Planes::room).sum()
    }
}

/// All the memory of one estimate.
#[derive(Debug, Default)]
pub(super) struct Workspace<T> {
    pub pyramid: Pyramid<T>,
    pub pool: Pool<T>,
    pub scratch: CoupleScratch<T>,
    pub space: Space<T>,
}

impl<T: SimdReal> Workspace<T> {
    /// Whether there is so much memory that results should not need theirs besides.
    pub fn is_large(&self) -> bool {
        self.bytes() > LIMIT
    }

    /// Lets go of what is free if there is so much memory that it matters more than the time to get it again.
    pub fn clear_large(&self) {
        if self.is_large() {
            self.clear();
        }
    }

    /// Lets go of what is free.
    pub fn clear(&self) {
        lock(&self.space.free).clear();
    }

    /// Gives what is free back to the system if there is so much memory that it matters more than the time to
    /// get it again: blocks of other sizes would not fit into it.
    pub fn give_back_large(&self) {
        if self.is_large() {
            self.clear();
            give_back();
        }
    }

    /// Gives all but what is `needed` back to the system. That takes time, since the next estimate has to ask
    /// for it again.
    pub fn give_back<'a>(&mut self, needed: impl Iterator<Item = &'a mut Planes<T>>) {
        *self = Self::default();
        needed.for_each(Planes::shrink);
        give_back();
    }

    fn bytes(&self) -> usize {
        (self.pyramid.samples() + self.space.room()) * size_of::<T>()
    }
}

/// Hands freed memory back to the system. The GNU allocator keeps blocks of up to 32 MiB for later, among
/// them most of ours, while results are too large to fit in.
fn give_back() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: takes no pointer, and may be called at any time from any thread.
    unsafe {
        libc::malloc_trim(0);
    }
}

/// Largest workspace that outlives its estimator, bytes: that of a frame of some 800,000 px.
const LIMIT: usize = 64 << 20;

/// The workspace of the estimator that was dropped last.
static LAST: PerProcess<Mutex<Option<Box<dyn Any + Send>>>> = PerProcess::new();

/// An estimator's workspaces: as many as it has had calls at a time.
#[derive(Debug, Default)]
pub(super) struct Memory {
    free: Mutex<Vec<Box<dyn Any + Send>>>,
}

impl Memory {
    /// A workspace, used before if possible.
    pub fn take<T: SimdReal>(&self) -> Box<Workspace<T>> {
        let own = lock(&self.free).pop();
        let any = own.or_else(|| lock(LAST.get()).take());
        any.and_then(|any| any.downcast().ok()).unwrap_or_default()
    }

    /// Keeps a workspace for later.
    pub fn give<T: SimdReal>(&self, workspace: Box<Workspace<T>>) {
        lock(&self.free).push(workspace);
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        let Some(any) = lock(&self.free).pop() else { return };
        let bytes = any.downcast_ref::<Workspace<f32>>().map(Workspace::bytes);
        let bytes = bytes.or_else(|| any.downcast_ref::<Workspace<f64>>().map(Workspace::bytes));
        if bytes.is_some_and(|bytes| bytes <= LIMIT) {
            *lock(LAST.get()) = Some(any);
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
