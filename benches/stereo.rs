//! Time of matching two views and of a step of the stereo tracker, 640 x 480, on one thread and on two:
//! direction classes beside semi-global matching, the paper's mode beside the improved one, whose mixture
//! begins where the last one ended.
//!
//! `JACOFLOW_SIMD=scalar` times the scalar twins of the kernels. `python -m benchmarks.tables.stereo` and
//! `stereo_tracking.py` give the quality that goes with the times.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use jacoflow::image::GaussianSmoother;
use jacoflow::math::random::CounterRng;
use jacoflow::parallel::Threads;
use jacoflow::stereo::{EdgeDisparityOptions, Method, edge_disparity, estimate_row_offset};
use jacoflow::track::StereoTracker;
use jacoflow::track::stereo::{StereoMode, StereoTrackerOptions};
use jacoflow::types::Frame;
use std::hint::black_box;
use std::time::Duration;

const SIZE: (usize, usize) = (640, 480);
/// Steps of the sequence, which then runs backwards.
const STEPS: usize = 8;

/// Three walls of soft cells, near ones before far ones, each with its own disparity and motion.
struct Scene {
    textures: Vec<Frame<f32>>,
}

/// Left and right end at the first step, upper end, disparity, motion: px.
const WALLS: [([f64; 2], usize, f64, f64); 3] =
    [([-400.0, 1400.0], 0, -24.0, 2.0), ([120.0, 280.0], 120, -6.0, 6.0), ([380.0, 520.0], 180, 8.0, -5.0)];

impl Scene {
    fn new() -> Self {
        let smoother = GaussianSmoother::new(1.2).expect("a width of smoothing");
        let texture = |index: usize| {
            let rng = CounterRng::new(index as u64);
            let level =
                |x: usize, y: usize| 40.0 + 170.0 * rng.uniform((1000 * ((y + x / 5) / 19) + (x + y / 3) / 23) as u64);
            smoother.apply(&Frame::from_fn(900, 480, |x, y| level(x, y) as f32))
        };
        Self { textures: (0..WALLS.len()).map(texture).collect() }
    }

    /// A view in which everything of disparity `d` is shifted by `-share d`, with a little noise.
    fn view(&self, t: usize, share: f64) -> Frame<f32> {
        let noise = CounterRng::new(77).stream(2 * t as u64 + share as u64);
        Frame::from_fn(SIZE.0, SIZE.1, |x, y| {
            let shown = WALLS.iter().zip(&self.textures).rev().find_map(|((ends, top, disparity, speed), texture)| {
                let at = x as f64 + share * disparity - speed * t as f64;
                let inside = (ends[0]..ends[1]).contains(&at) && y >= *top;
                inside.then(|| texture.get((at + 100.0).round() as usize % 900, y))
            });
            shown.unwrap_or(0.0) + 2.0 * noise.normal((y * SIZE.0 + x) as u64) as f32
        })
    }

    fn sequence(&self) -> Vec<[Frame<f32>; 2]> {
        (0..STEPS).map(|t| [self.view(t, 0.0), self.view(t, 1.0)]).collect()
    }
}

fn threads(count: usize) -> Threads {
    Threads::new(Some(count)).expect("a number of threads")
}

fn matching(criterion: &mut Criterion) {
    let [left, right] = &Scene::new().sequence()[0];
    let mut group = criterion.benchmark_group("matching");
    group.sample_size(10).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(2));
    for count in [1, 2] {
        let plain = EdgeDisparityOptions { threads: threads(count), row_offset: Some(0.0), ..Default::default() };
        let classes = EdgeDisparityOptions { method: Method::Classes, ..plain.clone() };
        let contestants = [
            ("classes, rows given", classes.clone()),
            ("classes, 9 rows searched", EdgeDisparityOptions { row_offset: None, ..classes }),
            ("sgm", plain.clone()),
            (
                "sgm, unchecked, whole px",
                EdgeDisparityOptions { left_right_check: false, subpixel: false, ..plain.clone() },
            ),
        ];
        for (name, options) in contestants {
            group.bench_function(BenchmarkId::new(name, count), |bencher| {
                bencher.iter(|| edge_disparity(black_box(left), right, &options).expect("views that fit"));
            });
        }
        group.bench_function(BenchmarkId::new("row offset", count), |bencher| {
            bencher.iter(|| estimate_row_offset(black_box(left), right, &plain).expect("views that fit"));
        });
    }
    group.finish();
}

fn tracking(criterion: &mut Criterion) {
    let sequence = Scene::new().sequence();
    let mut group = criterion.benchmark_group("stereo tracker, a step");
    group.sample_size(10).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(3));
    for count in [1, 2] {
        for mode in [StereoMode::Paper, StereoMode::Improved] {
            let options = StereoTrackerOptions { threads: threads(count), ..StereoTrackerOptions::new(mode) };
            let mut tracker = StereoTracker::new(options).expect("options in range");
            group.bench_function(BenchmarkId::new(mode.name(), count), |bencher| {
                bencher.iter(|| {
                    // There and back again: nothing jumps.
                    let place = tracker.steps() % (2 * STEPS - 2);
                    let [left, right] = &sequence[if place < STEPS { place } else { 2 * STEPS - 2 - place }];
                    black_box(tracker.update(left, right).expect("views that fit"))
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, matching, tracking);
criterion_main!(benches);
