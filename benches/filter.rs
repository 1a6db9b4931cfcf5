//! Time of the dense flow filter, per form, precision, instruction set and number of threads.
//!
//! Throughput is in pixel-steps: one prediction and one update of one pixel. The frames are 640 x 128, so
//! that the states of a single-precision run (30 MB) do not fit into a cache, as those of a full frame would
//! not.
//!
//! Then the parts of a particle filter's cycle, in particles; `python -m benchmarks.tables.particle_filter`
//! times it beside NumPy and filterpy.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use jacoflow::filter::particle::{ParticleFilter, Resampling};
use jacoflow::math::random::CounterRng;
use jacoflow::parallel::Threads;
use jacoflow::simd::Level;
use jacoflow::temporal::{FilterForm, FlowFilter, FlowFilterOptions, Transition};
use jacoflow::types::Frame;
use std::hint::black_box;
use std::time::Duration;

const SIZE: (usize, usize) = (640, 128);

/// A smooth texture that drifts.
fn frames() -> Vec<Frame<f64>> {
    (0..8)
        .map(|t| {
            let t = f64::from(t);
            Frame::from_fn(SIZE.0, SIZE.1, |x, y| {
                let (x, y) = (x as f64 - 0.3 * t, y as f64 + 0.2 * t);
                128.0 + 20.0 * (x * 0.11 + y * 0.05).sin() + 15.0 * (y * 0.13 - x * 0.03).cos()
            })
        })
        .collect()
}

macro_rules! measure {
    ($criterion:expr, $t:ty, $name:literal, $form:expr, $transition:expr, $level:expr, $threads:expr) => {{
        let frames: Vec<Frame<$t>> = frames().iter().map(|f| f.map(|&v| v as $t)).collect();
        let options = FlowFilterOptions {
            form: $form,
            transition: $transition,
            threads: Threads::new(Some($threads)).expect("a positive number"),
            simd: Some($level),
            ..FlowFilterOptions::patent()
        };
        let mut filter = FlowFilter::<$t>::new(SIZE, options).expect("valid options");
        let mut group = $criterion.benchmark_group(format!("{}/{}", $form.name(), $transition.name()));
        group.throughput(Throughput::Elements((SIZE.0 * SIZE.1) as u64));
        group.sample_size(10).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(2));
        let id = BenchmarkId::new(format!("{}/{}", $name, $level.name()), format!("{} thread", $threads));
        let mut next = 0;
        group.bench_function(id, |bencher| {
            bencher.iter(|| {
                next += 1;
                black_box(filter.push(&frames[next % frames.len()]).expect("frames of one size"))
            });
        });
        group.finish();
    }};
}

fn filter(criterion: &mut Criterion) {
    for form in FilterForm::ALL {
        for level in Level::available() {
            measure!(criterion, f32, "f32", form, Transition::Rk4, level, 1);
            measure!(criterion, f64, "f64", form, Transition::Rk4, level, 1);
        }
        let best = Level::detect();
        measure!(criterion, f32, "f32", form, Transition::Rk4, best, 2);
        measure!(criterion, f32, "f32", form, Transition::Exact, best, 1);
    }
}

/// Particles of the parts of a cycle.
const PARTICLES: usize = 20_000;

fn particles(criterion: &mut Criterion) {
    let mut filter = ParticleFilter::new(1, PARTICLES, 2, 0).expect("valid sizes");
    filter.threads = Threads::new(Some(1)).expect("a positive number");
    filter.sample_gaussian(&[0.0; 2], &[4.0, 0.0, 0.0, 4.0]).expect("a covariance");
    let mut group = criterion.benchmark_group("particle");
    group.throughput(Throughput::Elements(PARTICLES as u64));
    group.sample_size(10).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(2));
    let (transition, noise) = ([0.9, 0.1, 0.0, 0.9], [0.05, 0.0, 0.0, 0.02]);
    group.bench_function("predict_linear", |bencher| {
        bencher.iter(|| filter.predict_linear(&transition, &noise).expect("finite particles"));
    });
    group.bench_function("update", |bencher| {
        bencher.iter(|| {
            filter.update(|x, out| {
                x.chunks_exact(2).zip(out).for_each(|(x, out)| *out = -0.5 * (x[0] - 0.3).powi(2));
                Ok(())
            })
        });
    });
    let weights: Vec<f64> = (0..PARTICLES as u64).map(|i| CounterRng::new(1).uniform(i).powi(3)).collect();
    let mut indices = Vec::new();
    for scheme in Resampling::ALL {
        group.bench_function(scheme.name(), |bencher| {
            bencher.iter(|| scheme.indices(&weights, PARTICLES, &CounterRng::new(2), black_box(&mut indices)));
        });
    }
    group.finish();
}

criterion_group!(benches, filter, particles);
criterion_main!(benches);
