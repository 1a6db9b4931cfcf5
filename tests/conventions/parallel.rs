//! Threads and bands of rows.

use jacoflow::parallel::{BAND_ROWS, MAX_PER_PROCESSOR, Threads, for_each_band};

#[test]
fn bands_cover_every_row_once_for_any_thread_count() {
    for threads in [1, 2, 3] {
        let mut buffer = vec![0u32; 37 * 5];
        Threads::new(Some(threads)).unwrap().install(|| {
            for_each_band(&mut buffer, 5, |band, rows, slice| {
                assert_eq!(rows.start, band * BAND_ROWS);
                assert_eq!(slice.len(), rows.len() * 5);
                for value in slice {
                    *value += 1;
                }
            });
        });
        assert!(buffer.iter().all(|&v| v == 1));
    }
}

#[test]
fn a_million_threads_are_not_started() {
    let processors = std::thread::available_parallelism().unwrap().get();
    assert_eq!(Threads::new(Some(1_000_000)).unwrap().count(), MAX_PER_PROCESSOR * processors);
    assert_eq!(Threads::new(Some(1)).unwrap().count(), 1);
}

#[test]
fn zero_threads_are_refused() {
    assert!(Threads::new(Some(0)).unwrap_err().to_string().contains("threads"));
}
