//! Windowed estimates of a 640 x 480 frame in single precision, one thread.

use criterion::{Criterion, criterion_group, criterion_main};
use jacoflow::flow::windowed::{RowSet, WindowedOptions};
use jacoflow::flow::{Estimator, EstimatorOptions, Method};
use jacoflow::parallel::Threads;
use jacoflow::types::{FlowField, Frame};
use std::hint::black_box;

fn frames() -> Vec<Frame<f32>> {
    let wave = |x: f32, y: f32| {
        128.0 + 40.0 * (0.31 * x + 0.2 * y).sin() + 35.0 * (0.23 * y - 0.4 * x + 1.0).cos() * (0.5 * y).sin()
    };
    (0..3)
        .map(|t| {
            let t = t as f32;
            Frame::from_fn(640, 480, |x, y| wave(x as f32 - 0.3 * t, y as f32 + 0.2 * t).round())
        })
        .collect()
}

fn windowed(c: &mut Criterion) {
    let frames = frames();
    let refs: Vec<&Frame<f32>> = frames.iter().collect();
    let mut group = c.benchmark_group("windowed 640x480 f32");
    group.sample_size(20);
    for rows in RowSet::ALL {
        for covariance in [false, true] {
            let threads = Threads::new(Some(1)).expect("one thread");
            let common = EstimatorOptions { covariance, threads, ..EstimatorOptions::default() };
            let options = WindowedOptions { rows, ..WindowedOptions::default() };
            let estimator = Estimator::new(Method::Windowed(options), common).expect("default options");
            let mut field: FlowField<f32> = estimator.estimate(&refs, 0).expect("three frames of one size");
            let name = format!("{}{}", rows.name(), if covariance { ", covariance" } else { "" });
            group.bench_function(name, |b| {
                b.iter(|| estimator.estimate_into(black_box(&refs), 0, &mut field).expect("as before"));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, windowed);
criterion_main!(benches);
