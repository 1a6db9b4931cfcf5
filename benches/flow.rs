//! Jets, instantaneous flow, corners and flow at points, 640x480, f32, one thread, at each instruction set of
//! this processor.
//!
//! The frames are a noise texture in affine motion with noise and rounding, as a camera would deliver it.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use jacoflow::flow::instantaneous::InstantaneousOptions;
use jacoflow::flow::points::{PointFlowOptions, PointPyramid, track_points};
use jacoflow::flow::{Estimator, EstimatorOptions, Method};
use jacoflow::image::{CORNER_WINDOW, CornerOptions, corner_score_into, select_corners};
use jacoflow::jet::{JetStencil, Neighbourhood, TimeScheme};
use jacoflow::parallel::Threads;
use jacoflow::simd::Level;
use jacoflow::synth::{AffineTexture, Scene, Sensor};
use jacoflow::types::Frame;
use std::hint::black_box;
use std::time::Duration;

const SIZE: (usize, usize) = (640, 480);

fn frames() -> Vec<Frame<f32>> {
    let scene = AffineTexture::reference(SIZE.0, SIZE.1, 1).expect("the reference texture is valid");
    let sensor = Sensor::eight_bit(2.0, 1);
    (0..3u32).map(|t| sensor.apply(&scene.frame(f64::from(t)), u64::from(t)).map(|&v| v as f32)).collect()
}

fn one_thread() -> Threads {
    Threads::new(Some(1)).expect("one is a number of threads")
}

fn jets(c: &mut Criterion) {
    let frames = frames();
    let mut group = c.benchmark_group("jets_640x480_f32");
    group.throughput(Throughput::Elements((SIZE.0 * SIZE.1) as u64));
    for side in [3, 9] {
        let stencil = JetStencil::new(&Neighbourhood::square(side), (1.0, 1.0)).expect("a square is a neighbourhood");
        for level in Level::available() {
            let id = BenchmarkId::new(format!("{side}x{side}"), level.name());
            group.bench_function(id, |b| b.iter(|| stencil.planes_with(black_box(&frames[0]), one_thread(), level)));
        }
    }
    group.finish();
}

fn instantaneous(c: &mut Criterion) {
    let frames = frames();
    let three = [&frames[0], &frames[1], &frames[2]];
    let mut group = c.benchmark_group("instantaneous_640x480_f32");
    group.throughput(Throughput::Elements((SIZE.0 * SIZE.1) as u64));
    for (name, side, scheme) in [
        ("3x3_central", 3, TimeScheme::Central),
        ("3x3_backward", 3, TimeScheme::Backward),
        ("7x7_central", 7, TimeScheme::Central),
    ] {
        for level in Level::available() {
            let neighbourhood = Neighbourhood::square(side);
            let options = InstantaneousOptions { scheme, neighbourhood, ..InstantaneousOptions::default() };
            let common = EstimatorOptions { threads: one_thread(), simd: Some(level), ..EstimatorOptions::default() };
            let estimator = Estimator::new(Method::Instantaneous(options), common).expect("the options are valid");
            let mut field = estimator.estimate(&three, 0).expect("the frames are valid");
            // A stream reuses its field; the second form makes a new one each time.
            group.bench_function(BenchmarkId::new(name, level.name()), |b| {
                b.iter(|| estimator.estimate_into(black_box(&three), 0, &mut field).expect("the frames are valid"));
            });
            if side == 3 && scheme == TimeScheme::Central {
                group.bench_function(BenchmarkId::new("3x3_central_new_field", level.name()), |b| {
                    b.iter(|| estimator.estimate(black_box(&three), 0).expect("the frames are valid"));
                });
            }
        }
    }
    for (name, covariance, diagnostics) in [("3x3_covariance", true, false), ("3x3_diagnostics", false, true)] {
        for level in Level::available() {
            let common = EstimatorOptions {
                threads: one_thread(),
                simd: Some(level),
                covariance,
                diagnostics,
                ..EstimatorOptions::default()
            };
            let method = Method::Instantaneous(InstantaneousOptions::default());
            let estimator = Estimator::new(method, common).expect("the options are valid");
            let mut field = estimator.estimate(&three, 0).expect("the frames are valid");
            group.bench_function(BenchmarkId::new(name, level.name()), |b| {
                b.iter(|| estimator.estimate_into(black_box(&three), 0, &mut field).expect("the frames are valid"));
            });
        }
    }
    group.finish();
}

fn points(c: &mut Criterion) {
    let [before, after] = [0, 1].map(|t| frames().swap_remove(t));
    let mut group = c.benchmark_group("points_640x480_f32");
    let mut score = Frame::default();
    for level in Level::available() {
        group.bench_function(BenchmarkId::new("corner_score", level.name()), |b| {
            b.iter(|| corner_score_into(level, black_box(&before), CORNER_WINDOW, &mut score).expect("a window"));
        });
    }
    let options = CornerOptions { max_count: 1600, ..CornerOptions::default() };
    let corners = select_corners(&score, &[], &options);
    group.bench_function("select_corners", |b| b.iter(|| select_corners(black_box(&score), &[], &options)));
    let [before, after] = [before, after].map(|frame| PointPyramid::new(frame, 3));
    group.throughput(Throughput::Elements(corners.len() as u64));
    for (window, level) in [11, 19].into_iter().flat_map(|w| Level::available().into_iter().map(move |l| (w, l))) {
        let options = PointFlowOptions { window, simd: Some(level), ..PointFlowOptions::default() };
        let run = || track_points(black_box(&before), &after, &corners, None, &options).expect("valid options");
        group.bench_function(BenchmarkId::new(format!("track_points_{window}x{window}"), level.name()), |b| {
            one_thread().install(|| b.iter(run));
        });
    }
    group.finish();
}

fn quick() -> Criterion {
    Criterion::default()
        .sample_size(30)
        .warm_up_time(Duration::from_millis(500))
        .measurement_time(Duration::from_secs(2))
}

criterion_group!(name = layers; config = quick(); targets = jets, instantaneous, points);
criterion_main!(layers);
