//! Time of a round of the weighted variational mixture: 12 components, 5000 points in 2, 3, 6 and 10
//! dimensions, on one thread; first seeds apart. Then whole fits of Dirichlet-process mixtures to 1600 points
//! in the plane, as the particle tracker needs two a frame.
//!
//! `python -m benchmarks.tables.mixture` and `python -m benchmarks.tables.dirichlet_mixture` time the same
//! beside scikit-learn's.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use jacoflow::math::random::CounterRng;
use jacoflow::mixture::{
    CovariancePrior, DirichletOptions, Inference, MixtureOptions, Points, Start, fit, fit_dirichlet,
};
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

/// Number of corners of a frame of 480 rows.
const CORNERS: usize = 1600;

/// Flow vectors of a background, two moving objects and outliers, px/frame.
fn flow() -> Vec<f64> {
    let rng = CounterRng::new(3);
    let vector = |n: u64| -> [f64; 2] {
        let noise = [rng.normal(2 * n), rng.normal(2 * n + 1)];
        let anywhere = [12.0 * rng.stream(1).uniform(n) - 6.0, 12.0 * rng.stream(2).uniform(n) - 6.0];
        match n % 25 {
            0..20 => [1.5 + 0.12 * noise[0], -0.6 + 0.12 * noise[1]],
            20..22 => [3.0 + 0.4 * noise[0], -0.5 + 0.3 * noise[1]],
            22..24 => [-1.0 + 0.4 * noise[0], -0.5 + 0.3 * noise[1]],
            _ => anywhere,
        }
    };
    (0..CORNERS as u64).flat_map(vector).collect()
}

/// Positions all over a picture of 720 x 480 px, where no number of Gaussians is the right one, and their
/// weights.
fn positions() -> (Vec<f64>, Vec<f64>) {
    let rng = CounterRng::new(4);
    let place = |n: u64| [720.0 * rng.stream(1).uniform(n), 480.0 * rng.stream(2).uniform(n)];
    let places = (0..CORNERS as u64).flat_map(place).collect();
    (places, (0..CORNERS as u64).map(|n| rng.uniform(n)).collect())
}

fn dirichlet(c: &mut Criterion) {
    let mut group = c.benchmark_group("dirichlet mixture");
    group.measurement_time(Duration::from_secs(3)).sample_size(20);
    let threads = Threads::new(Some(1)).expect("one thread");
    let (flow, (places, weights)) = (flow(), positions());
    let of_flow = DirichletOptions { covariance_floor: 0.05 * 0.05, threads, ..DirichletOptions::default() };
    let of_places = DirichletOptions {
        covariance_floor: 4.0 * 4.0,
        covariance_prior: CovariancePrior::Isotropic(24.0 * 24.0),
        ..of_flow.clone()
    };
    for (name, values, weights, options) in
        [("flow", &flow, None, of_flow), ("positions", &places, Some(&weights[..]), of_places)]
    {
        let points = Points { dimensions: 2, values, weights };
        let plain = DirichletOptions { merge: false, ..options.clone() };
        let variational = DirichletOptions { inference: Inference::Vb, ..plain.clone() };
        for (method, options) in [("merging", options), ("no merging", plain), ("variational", variational)] {
            group.bench_function(BenchmarkId::new(name, method), |b| b.iter(|| fit_dirichlet(&points, &options)));
        }
    }
    group.finish();
}

criterion_group!(benches, rounds, dirichlet);
criterion_main!(benches);
