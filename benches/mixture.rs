//! Time of a round of the weighted variational mixture: 12 components, 5000 points in 2, 3, 6 and 10 dimensions, on one thread; first seeds apart.
//!
//! `python benchmarks/mixture.py` times the same beside scikit-learn's.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use jacoflow::math::random::CounterRng;
use jacoflow::mixture::{CovariancePrior, MixtureOptions, Points, Start, fit};
use jacoflow::parallel::Threads;
use std::hint::black_box;
use std::time::Duration;

const POINTS: usize = 5000;
const COMPONENTS: usize = 12;
/// Rounds of one measurement.
const ROUNDS: usize = 20;

/// Points about as many centres as there are components.
fn points(dimensions: usize) -> Vec<f64> {
    let rng = CounterRng::new(1);
    let centre = |n: usize, d: usize| 10.0 * rng.stream((n % COMPONENTS) as u64).normal(d as u64);
    let at = |i: usize| centre(i / dimensions, i % dimensions) + 2.0 * rng.normal(i as u64);
    (0..POINTS * dimensions).map(at).collect()
}

fn options(max_iter: usize) -> MixtureOptions {
    let threads = Threads::new(Some(1)).expect("one thread");
    let covariance_prior = CovariancePrior::Isotropic(0.1);
    MixtureOptions {
        components: COMPONENTS,
        covariance_prior,
        tol: None,
        max_iter,
        threads,
        ..MixtureOptions::default()
    }
}

fn rounds(c: &mut Criterion) {
    let mut group = c.benchmark_group("mixture");
    group.measurement_time(Duration::from_secs(3)).sample_size(20);
    for dimensions in [2, 3, 6, 10] {
        let values = points(dimensions);
        let points = Points { dimensions, values: &values, weights: None };
        let begun = fit(&points, &options(1), Start::Seeds).expect("points can be fitted").posterior;
        group.bench_function(BenchmarkId::new("20 rounds", dimensions), |b| {
            b.iter(|| fit(black_box(&points), &options(ROUNDS), Start::Components(&begun)));
        });
        group.bench_function(BenchmarkId::new("seeds and one round", dimensions), |b| {
            b.iter(|| fit(black_box(&points), &options(1), Start::Seeds));
        });
    }
    group.finish();
}

criterion_group!(benches, rounds);
criterion_main!(benches);
