//! Time of 3-D motion from the flow of 1000 and 100 000 points, on two threads: maximum likelihood, smoothed
//! weights, robust search.
//!
//! `python -m benchmarks.tables.motion3d_speed` times the same beside OpenCV's essential matrices.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use jacoflow::math::random::CounterRng;
use jacoflow::motion3d::{Flow, Method, Motion, MotionOptions, Noise, Placement, estimate_motion};
use jacoflow::parallel::Threads;
use std::hint::black_box;
use std::time::Duration;

/// Standard deviation of the flow: about 1/30 of it.
const SIGMA: f64 = 0.02;

/// Points in [-0.6, 0.6]^2 over a wavy surface, and their flow.
fn scene(n: usize) -> (Vec<[f64; 2]>, Vec<[f64; 2]>) {
    let (rng, motion) = (CounterRng::new(1), Motion::new([0.6, 0.2, 0.75], [0.02, -0.03, 0.01]));
    let points: Vec<[f64; 2]> = (0..n as u64).map(|k| [0, 1].map(|j| 1.2 * rng.uniform(2 * k + j) - 0.6)).collect();
    let noise = rng.stream(1);
    let flow = points.iter().enumerate().map(|(k, &p)| {
        let depth = 1.0 + 0.35 * (3.3 * p[0] + 1.0).sin() * (2.5 * p[1]).cos();
        let exact = motion.plane_flow(p, depth);
        [0, 1].map(|j| exact[j] + SIGMA * noise.normal(2 * k as u64 + j as u64))
    });
    let flow = flow.collect();
    (points, flow)
}

fn estimates(c: &mut Criterion) {
    let mut group = c.benchmark_group("motion3d");
    group.measurement_time(Duration::from_secs(3)).sample_size(20);
    for n in [1000, 100_000] {
        let (points, flow) = scene(n);
        let flow = Flow::Plane { points: &points, flow: &flow, camera: None };
        for (name, method, robust) in [
            ("maximum likelihood", Method::MaximumLikelihood, false),
            ("smoothed weights", Method::Efficient, false),
            ("robust maximum likelihood", Method::MaximumLikelihood, true),
        ] {
            let options = MotionOptions {
                method,
                robust,
                placement: Placement::Start,
                threads: Threads::new(Some(2)).expect("two threads"),
                ..MotionOptions::default()
            };
            group.bench_function(BenchmarkId::new(name, n), |b| {
                b.iter(|| estimate_motion(black_box(&flow), &Noise::StandardDeviation(SIGMA), &options));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, estimates);
criterion_main!(benches);
