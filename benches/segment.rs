//! Time of the graph segmentation of a colour image of 720 x 480 px (scale 150, sigma 0.8, regions of at
//! least 120 px), on one and two threads.
//!
//! `python -m benchmarks.tables.segmentation` times the same beside scikit-image's and OpenCV's.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use jacoflow::math::random::CounterRng;
use jacoflow::parallel::Threads;
use jacoflow::segment::{SegmentOptions, felzenszwalb, region_means};
use jacoflow::types::{ColourFrame, Frame};
use std::hint::black_box;

const WIDTH: usize = 720;
const HEIGHT: usize = 480;

/// Coloured tiles of 24 px under a slow shade, with noise of 3 levels, in levels 0 to 255.
fn picture() -> ColourFrame<f32> {
    let rng = CounterRng::new(1);
    Frame::from_fn(WIDTH, HEIGHT, |x, y| {
        let tile = rng.stream((x / 24 + 100 * (y / 24)) as u64);
        let noise = rng.stream(1_000_000 + (y * WIDTH + x) as u64);
        let shade = 20.0 * ((x + 2 * y) as f64 / 90.0).sin();
        std::array::from_fn(|c| {
            let level = 128.0 + shade + 30.0 * tile.normal(c as u64) + 3.0 * noise.normal(c as u64);
            level.clamp(0.0, 255.0).round() as f32
        })
    })
}

fn segmentation(c: &mut Criterion) {
    let image = picture();
    let options = SegmentOptions { scale: 150.0, sigma: 0.8, min_size: 120 };
    let mut group = c.benchmark_group("segment");
    group.sample_size(20);
    for count in [1, 2] {
        let threads = Threads::new(Some(count)).expect("a positive number");
        group.bench_function(BenchmarkId::new("felzenszwalb", count), |b| {
            b.iter(|| threads.install(|| felzenszwalb(black_box(&image), &options)));
        });
    }
    let labels = felzenszwalb(&image, &options).expect("valid options");
    let values: Vec<f32> = image.data().iter().map(|pixel| pixel[0]).collect();
    group.bench_function("region_means", |b| {
        b.iter(|| region_means(black_box(&labels.labels), labels.count, &values, 1));
    });
    group.finish();
}

criterion_group!(benches, segmentation);
criterion_main!(benches);
