//! Tasks that the threads of a pool share: the one place that calls rayon's parallel iterators.
//!
//! Rayon's functions are generic over the work and hold several copies of it. Here they get it behind a
//! pointer and are compiled once; what is generic below is a loop.

use super::interrupt::{checkpoint, current, under};
use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// Calls `work` with every number below `count`, each in a task of its own.
///
/// Each is a [`checkpoint`] of the work that they belong to. Outside of every pool, that of the default
/// number of threads does it: never rayon's global one.
fn run_tasks(count: usize, work: &(dyn Fn(usize) + Sync)) {
    let interrupt = current();
    // Also without a request that may come: a thread that waits for one work does tasks of another.
    run_unwatched(count, &|number| {
        under(interrupt.clone(), || {
            checkpoint();
            work(number);
        });
    });
}

fn run_unwatched(count: usize, work: &(dyn Fn(usize) + Sync)) {
    if count > 1 && is_outside() {
        super::install(super::Threads::default().count(), &mut || run_unwatched(count, work));
    } else if count > 1 && rayon::current_num_threads() > 1 {
        // One number a task: with larger shares one thread would wait for the other.
        (0..count).into_par_iter().with_max_len(1).for_each(work);
    } else {
        (0..count).for_each(work);
    }
}

/// Whether this thread belongs to no pool.
pub(super) fn is_outside() -> bool {
    rayon::current_thread_index().is_none()
}

/// How many threads share the tasks of this one. Results must not depend on it.
pub(crate) fn thread_count() -> usize {
    // To count threads outside of every pool, rayon would start its global one.
    if is_outside() { super::Threads::default().count() } else { rayon::current_num_threads() }
}

/// Calls `work` with every item, each in a task of its own: it should take some microseconds.
///
/// Call this and the functions below inside [`Threads::install`](super::Threads::install).
pub(crate) fn for_each<I: IntoIterator<Item: Send>>(items: I, work: impl Fn(I::Item) + Sync) {
    let items: Vec<_> = items.into_iter().map(|item| Mutex::new(Some(item))).collect();
    run_tasks(items.len(), &|index| {
        // Nobody waits for this lock: each task has its own item.
        let item = items[index].lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(item) = item {
            work(item);
        }
    });
}

/// Calls `work` with the place of every value and the value; a task has `group` of them.
///
/// `group` must be a constant: were it to depend on the number of threads, so might the results.
pub(crate) fn for_each_value<T: Send>(values: &mut [T], group: usize, work: impl Fn(usize, &mut T) + Sync) {
    for_each(values.chunks_mut(group).enumerate(), |(task, values)| {
        for (place, value) in (task * group..).zip(values) {
            work(place, value);
        }
    });
}

/// What `work` returns for every item, in the order of the items, each computed in a task of its own.
pub(crate) fn map<I: IntoIterator<Item: Send>, R: Send>(items: I, work: impl Fn(I::Item) -> R + Sync) -> Vec<R> {
    let items: Vec<_> = items.into_iter().collect();
    let mut results: Vec<Option<R>> = items.iter().map(|_| None).collect();
    for_each(items.into_iter().zip(&mut results), |(item, result)| *result = Some(work(item)));
    results.into_iter().map(|result| result.expect("every task has run")).collect()
}

/// What `work` returns for every number below `count`, in their order; a task computes `group` of them, a
/// constant as in [`for_each_value`].
pub(crate) fn map_range<R: Send>(count: usize, group: usize, work: impl Fn(usize) -> R + Sync) -> Vec<R> {
    let of_group = |first: usize| (first..count.min(first + group)).map(&work).collect::<Vec<R>>();
    let mut results = Vec::with_capacity(count);
    for group in map((0..count).step_by(group), of_group) {
        results.extend(group);
    }
    results
}

/// What two tasks return.
pub(crate) fn join<A: Send, B: Send>(first: impl FnOnce() -> A + Send, second: impl FnOnce() -> B + Send) -> (A, B) {
    let (mut first, mut second, mut results) = (Some(first), Some(second), (None, None));
    let mut run_first = || results.0 = first.take().map(|first| first());
    let mut run_second = || results.1 = second.take().map(|second| second());
    let tasks: [&mut (dyn FnMut() + Send); 2] = [&mut run_first, &mut run_second];
    for_each(tasks, |task| task());
    (results.0.expect("the first task has run"), results.1.expect("the second task has run"))
}

#[cfg(test)]
mod tests {
    use super::super::Threads;
    use super::*;
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    fn pools() -> [Threads; 2] {
        [1, 3].map(|count| Threads::new(Some(count)).unwrap())
    }

    #[test]
    fn results_have_the_order_of_the_items() {
        for threads in pools() {
            threads.install(|| {
                let squares: Vec<usize> = (0..1001).map(|n| n * n).collect();
                assert_eq!(map(0..1001, |n| n * n), squares);
                assert_eq!(map_range(1001, 16, |n| n * n), squares);
                let mut values = vec![0; 1001];
                for_each_value(&mut values, 16, |n, value| *value = n * n);
                assert_eq!(values, squares);
                assert_eq!(join(|| 1, || "two"), (1, "two"));
                assert!(map_range(0, 16, |n| n).is_empty());
            });
        }
    }

    #[test]
    fn tasks_may_have_tasks_of_their_own() {
        for threads in pools() {
            let sums = threads.install(|| map(0..50, |n| map(0..50, |m| n * m).into_iter().sum::<usize>()));
            assert!(sums.iter().enumerate().all(|(n, sum)| *sum == n * 49 * 25));
        }
    }

    #[test]
    fn tasks_outside_every_pool_stay_out_of_the_global_one() {
        let is_own = |_| std::thread::current().name().is_some_and(|name| name.starts_with("jacoflow-"));
        assert!(map(0..100, is_own).into_iter().all(|is_own| is_own));
        assert_eq!(thread_count(), Threads::default().count());
    }

    #[test]
    fn a_panic_reaches_the_caller_and_items_are_dropped_once() {
        struct Item(Arc<AtomicUsize>);
        impl Drop for Item {
            fn drop(&mut self) {
                self.0.fetch_add(1, Ordering::Relaxed);
            }
        }
        for threads in pools() {
            let dropped = Arc::new(AtomicUsize::new(0));
            let items: Vec<_> = (0..100).map(|n| (n, Item(Arc::clone(&dropped)))).collect();
            let work = |(n, item): (usize, Item)| if n == 50 { std::panic::resume_unwind(Box::new(n)) } else { item };
            let result = catch_unwind(AssertUnwindSafe(|| threads.install(|| map(items, work).len())));
            assert!(result.is_err_and(|payload| payload.is::<usize>()));
            assert_eq!(dropped.load(Ordering::Relaxed), 100);
        }
    }
}
