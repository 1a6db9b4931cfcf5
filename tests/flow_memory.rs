//! Memory of the coarse-to-fine estimator, counted by the allocator: its peak, and allocations of a stream.

use jacoflow::flow::coarse_to_fine::{CoarseToFineOptions, Preset};
use jacoflow::flow::{Estimator, EstimatorOptions, Method};
use jacoflow::synth::{AffineTexture, Scene, Sensor};
use jacoflow::types::Frame;
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

const SIZE: (usize, usize) = (640, 480);
/// Bytes of one plane of 4-byte numbers, one a pixel.
const PLANE: usize = 4 * SIZE.0 * SIZE.1;
/// Maximum number of planes at any time, the result included.
const MAX_PLANES: usize = 80;
/// Estimates of a stream until every block has its final size.
const WARM_UP: usize = 3;

static HELD: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);
static LARGEST: AtomicUsize = AtomicUsize::new(0);

struct Counting;

// SAFETY: every call is the system's.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let held = HELD.fetch_add(layout.size(), Relaxed) + layout.size();
        PEAK.fetch_max(held, Relaxed);
        LARGEST.fetch_max(layout.size(), Relaxed);
        // SAFETY: as the caller promises.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Relaxed);
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn frames() -> Vec<Frame<f32>> {
    let scene = AffineTexture::moving(SIZE, [3.0, -2.0, 0.01, 0.02, -0.01, 0.01], 1).unwrap();
    let camera = Sensor::eight_bit(1.0, 1);
    (0..3u32).map(|t| camera.apply(&scene.frame(f64::from(t) - 1.0), u64::from(t)).map(|&v| v as f32)).collect()
}

/// One test, since the allocator counts for the whole process.
#[test]
fn an_estimate_holds_at_most_80_planes_and_a_stream_allocates_none_anew() {
    let three = frames();
    for (preset, count, covariance) in
        Preset::EVERY.into_iter().flat_map(|preset| [(preset, 2, false), (preset, 2, true), (preset, 3, true)])
    {
        let options = CoarseToFineOptions { preset, frames: count, ..CoarseToFineOptions::default() };
        let common = EstimatorOptions { covariance, ..EstimatorOptions::default() };
        let estimator = Estimator::new(Method::CoarseToFine(options), common).unwrap();
        let frames: Vec<&Frame<f32>> = three[3 - count..].iter().collect();
        // Estimators leave their work space to the next one for frames of the same size.
        let small: Vec<Frame<f32>> = frames.iter().map(|_| Frame::filled(32, 32, 0.0)).collect();
        estimator.estimate(&small.iter().collect::<Vec<_>>(), 0).unwrap();
        let given = HELD.load(Relaxed);
        PEAK.store(0, Relaxed);
        let mut field = estimator.estimate(&frames, 0).unwrap();
        for _ in 1..WARM_UP {
            estimator.estimate_into(&frames, 0, &mut field).unwrap();
        }
        LARGEST.store(0, Relaxed);
        estimator.estimate_into(&frames, 0, &mut field).unwrap();
        let (peak, largest) = (PEAK.load(Relaxed) - given, LARGEST.load(Relaxed));
        let case = format!("{} of {count} frames, covariance: {covariance}", preset.name());
        assert!(peak <= MAX_PLANES * PLANE, "{case}: {:.1} planes", peak as f64 / PLANE as f64);
        assert!(largest < PLANE, "{case}: {:.2} planes at once", largest as f64 / PLANE as f64);
    }
}
