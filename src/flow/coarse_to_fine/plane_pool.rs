//! Pool of planes: fresh memory costs about as much time as the work done in it.

use super::planes::Planes;
use crate::simd::SimdReal;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Maximum size of a block over what is needed: least memory at the peak of three frames.
const MAX_ROOM_RATIO: f64 = 1.5;

#[derive(Debug, Default)]
pub(super) struct PlanePool<T> {
    free: Mutex<Vec<Planes<T>>>,
}

impl<T: SimdReal> PlanePool<T> {
    /// Planes with any finite content: the smallest free ones large enough, but not much larger, since others
    /// need those; or else the largest smaller ones, enlarged.
    pub fn planes(&self, width: usize, height: usize, count: usize) -> Planes<T> {
        let mut planes = self.best(Planes::<T>::len(width, height, count));
        planes.reshape(width, height, count);
        planes
    }

    /// At least `len` samples of any finite value, chosen as [`PlanePool::planes`] are.
    pub fn samples(&self, len: usize) -> Vec<T> {
        let mut samples = self.best(len).into_samples();
        if samples.len() < len {
            samples = vec![T::from_f64(0.0); len];
        }
        samples
    }

    fn best(&self, len: usize) -> Planes<T> {
        let mut free = lock(&self.free);
        let fit =
            |planes: &Planes<T>| if planes.room() < len { (1, usize::MAX - planes.room()) } else { (0, planes.room()) };
        let allowed = (0..free.len()).filter(|&at| free[at].room() as f64 <= MAX_ROOM_RATIO * len as f64);
        let best = allowed.min_by_key(|&at| fit(&free[at]));
        best.map(|at| free.swap_remove(at)).unwrap_or_default()
    }

    pub fn keep(&self, planes: Planes<T>) {
        if planes.room() > 0 {
            lock(&self.free).push(planes);
        }
    }

    /// Free samples.
    pub fn room(&self) -> usize {
        lock(&self.free).iter().map(Planes::room).sum()
    }
}

pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
