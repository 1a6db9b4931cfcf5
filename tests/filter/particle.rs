//! The filter against the Kalman filter, naive sums, and its promises on random numbers.

use jacoflow::filter::KalmanFilter;
use jacoflow::filter::particle::{ParticleFilter, Resampling};
use jacoflow::math::random::CounterRng;
use jacoflow::parallel::Threads;
use proptest::prelude::*;
use std::f64::consts::TAU;

const F: [f64; 4] = [1.0, 1.0, 0.0, 1.0];

const Q: [f64; 4] = [0.05, 0.0, 0.0, 0.02];

const P0: [f64; 4] = [4.0, 0.0, 0.0, 4.0];

/// Variance of the measured position.
const R: f64 = 0.5;

/// Measurements of a constant-velocity motion with noise.
fn measurements(seed: u64, steps: usize) -> Vec<f64> {
    let rng = CounterRng::new(seed).stream(1000);
    let (mut position, mut velocity) = (2.0 * rng.normal(0), 2.0 * rng.normal(1));
    let mut next = 2;
    let mut normal = || {
        next += 1;
        rng.normal(next)
    };
    let mut all = vec![];
    for _ in 0..steps {
        position += velocity + Q[0].sqrt() * normal();
        velocity += Q[3].sqrt() * normal();
        all.push(position + R.sqrt() * normal());
    }
    all
}

fn log_normal(z: f64) -> impl Fn(&[f64], &mut [f64]) -> jacoflow::Result<()> {
    move |x, out| {
        for (x, out) in x.chunks_exact(2).zip(out) {
            *out = -0.5 * ((z - x[0]).powi(2) / R + (TAU * R).ln());
        }
        Ok(())
    }
}

fn start(batch: usize, particles: usize, seed: u64) -> ParticleFilter {
    let mut filter = ParticleFilter::new(batch, particles, 2, seed).unwrap();
    filter.sample_gaussian(&[0.0; 2], &P0).unwrap();
    filter
}

/// Bars of the specification: mean in sd / sqrt(ESS), variances relative, log evidence of a step.
const BARS: [f64; 3] = [10.0, 0.15, 0.25];

#[test]
fn a_linear_gaussian_model_gives_the_kalman_filter() {
    for seed in 0..3 {
        let mut kalman = KalmanFilter::new(1, 2, 1).unwrap();
        (kalman.F, kalman.H) = (F.to_vec(), vec![1.0, 0.0]);
        (kalman.state.P, kalman.state.Q, kalman.state.R) = (P0.to_vec(), Q.to_vec(), vec![R]);
        let mut filter = start(1, 20_000, seed);
        let mut worst = [0.0f64; 3];
        let mut sum = 0.0;
        for z in measurements(seed, 60) {
            kalman.predict().unwrap();
            kalman.update(&[z]).unwrap();
            filter.predict_linear(&F, &Q).unwrap();
            filter.update(log_normal(z)).unwrap();
            let (mean, covariance) = (filter.mean().unwrap(), filter.covariance().unwrap());
            let ess = filter.effective_sample_size().unwrap()[0];
            for i in 0..2 {
                let variance = kalman.state.P[3 * i];
                worst[0] = worst[0].max((mean[i] - kalman.state.x[i]).abs() * (ess / variance).sqrt());
                worst[1] = worst[1].max((covariance[3 * i] / variance - 1.0).abs());
            }
            worst[2] = worst[2].max((filter.log_evidence[0] - kalman.state.log_likelihood[0]).abs());
            sum += filter.log_evidence[0];
            filter.resample(Resampling::Systematic, None, None).unwrap();
        }
        assert!(worst.iter().zip(BARS).all(|(worst, bar)| *worst < bar), "seed {seed}: {worst:?}");
        assert!((filter.log_evidence_sum[0] - sum).abs() < 1e-9 && filter.degenerate == [0]);
    }
}

#[test]
fn estimates_are_those_of_naive_sums() {
    let mut filter = ParticleFilter::new(1, 4, 2, 0).unwrap();
    filter.x = vec![1.0, 8.0, 2.0, 6.0, 3.0, 4.0, 4.0, 2.0];
    filter.set_log_weights(&[1.0f64, 2.0, 3.0, 4.0].map(f64::ln)).unwrap();
    let near = |got: Vec<f64>, want: &[f64]| got.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-13);
    assert!(near(filter.mean().unwrap(), &[3.0, 4.0]));
    assert!(near(filter.covariance().unwrap(), &[1.0, -2.0, -2.0, 4.0]));
    assert!(near(filter.effective_sample_size().unwrap(), &[10.0 / 3.0]));
    assert_eq!(filter.map().unwrap(), [4.0, 2.0]);
    assert_eq!(filter.quantiles(&[0.0, 0.25, 0.5, 1.0]).unwrap(), [1.0, 2.0, 2.0, 2.0, 3.0, 4.0, 4.0, 8.0]);
    assert!(filter.quantiles(&[1.5]).unwrap_err().to_string().starts_with("q: expected numbers from 0 to 1, got 1.5"));
}

#[test]
fn an_impossible_measurement_is_refused_in_its_set_alone() {
    let mut filter = start(3, 50, 1);
    filter.update(log_normal(0.3)).unwrap();
    let before = filter.clone();
    filter
        .update(|_, out| {
            out[..50].fill(f64::NEG_INFINITY);
            out[50..100].fill(f64::NAN);
            out[100..].fill(-1.0);
            (out[3], out[100]) = (f64::NAN, f64::NAN);
            Ok(())
        })
        .unwrap();
    assert_eq!(filter.log_weights[..100], before.log_weights[..100]);
    assert_eq!(filter.degenerate, [1, 1, 0]);
    assert_eq!(filter.log_evidence[..2], [f64::NEG_INFINITY; 2]);
    assert_eq!(filter.log_evidence_sum[..2], before.log_evidence_sum[..2]);
    assert!(filter.log_weights[100] == f64::NEG_INFINITY && filter.log_evidence[2].is_finite());
    let again = filter.clone();
    let message = filter
        .update(|_, out| {
            out.fill(f64::INFINITY);
            Ok(())
        })
        .unwrap_err()
        .to_string();
    assert_eq!(message, "log_likelihood: expected a function with results below infinity, got inf");
    assert_eq!(filter, again);
}

#[test]
fn numbers_of_a_target_depend_on_neither_threads_nor_others() {
    let run = |batch: usize, targets: &[u64], threads: usize| {
        let mut filter = ParticleFilter::new(batch, 30_000, 2, 9).unwrap();
        filter.targets = targets.to_vec();
        filter.threads = Threads::new(Some(threads)).unwrap();
        filter.sample_gaussian(&[0.0; 2], &P0).unwrap();
        for z in measurements(4, 3) {
            filter.predict_linear(&F, &Q).unwrap();
            filter.update(log_normal(z)).unwrap();
            filter.resample(Resampling::Stratified, Some(0.5), None).unwrap();
        }
        filter
    };
    let three = run(3, &[0, 1, 7], 1);
    assert_eq!(three.x, run(3, &[0, 1, 7], 3).x);
    let alone = run(1, &[7], 2);
    assert_eq!(three.x[2 * 60_000..], alone.x);
    assert_eq!(three.log_weights[60_000..], alone.log_weights);
    assert_ne!(three.x[..60_000], three.x[60_000..120_000]);
}

#[test]
fn own_noise_and_built_in_noise_are_the_same_numbers() {
    let (mut one, mut other) = (start(2, 100, 3), start(2, 100, 3));
    let normal = other.standard_normal().unwrap();
    one.predict_linear(&F, &Q).unwrap();
    other
        .predict(
            |x, next| {
                for (k, next) in next.iter_mut().enumerate() {
                    let linear = if k % 2 == 0 { x[k] + x[k + 1] } else { x[k] };
                    *next = linear + Q[3 * (k % 2)].sqrt() * normal[k];
                }
                Ok(())
            },
            None,
        )
        .unwrap();
    assert_eq!(one.x, other.x);
    let mut third = start(2, 100, 3);
    third
        .predict(
            |x, next| {
                next.copy_from_slice(x);
                Ok(())
            },
            Some(&Q),
        )
        .unwrap();
    assert!(third.x.chunks_exact(2).zip(one.x.chunks_exact(2)).all(|(a, b)| (a[1] - b[1]).abs() < 1e-14));
    assert_ne!(one.standard_normal().unwrap(), normal);
}

#[test]
fn the_number_of_particles_may_change() {
    let mut filter = start(2, 400, 5);
    filter.update(log_normal(1.0)).unwrap();
    let mean = filter.mean().unwrap();
    for count in [4000, 100] {
        assert_eq!(filter.resample(Resampling::Systematic, Some(0.0), Some(count)).unwrap(), [true; 2]);
        assert_eq!((filter.particles(), filter.x.len()), (count, 4 * count));
        assert!(filter.log_weights.iter().all(|log| (log + (count as f64).ln()).abs() < 1e-15));
        let now = filter.mean().unwrap();
        assert!(now.iter().zip(&mean).all(|(a, b)| (a - b).abs() < 0.3), "{now:?} {mean:?}");
    }
    filter.predict_linear(&F, &Q).unwrap();
    let kept = filter.x.clone();
    assert_eq!(filter.resample(Resampling::Residual, Some(0.9), None).unwrap(), [false; 2]);
    assert_eq!(filter.x, kept);
}

#[test]
fn wrong_arguments_are_named_and_change_nothing() {
    for (batch, particles, dim_x, name) in [(0, 1, 1, "batch"), (1, 0, 1, "n_particles"), (1, 1, 0, "dim_x")] {
        assert!(ParticleFilter::new(batch, particles, dim_x, 0).unwrap_err().to_string().starts_with(name));
    }
    assert!(ParticleFilter::new(1 << 30, 1 << 30, 8, 0).unwrap_err().to_string().starts_with("n_particles"));
    let mut filter = start(1, 10, 0);
    let before = filter.clone();
    let nan = f64::NAN;
    let failures = [
        (filter.predict_linear(&F[..3], &Q), "F: expected 4 values"),
        (filter.predict_linear(&[nan; 4], &Q), "F: expected finite numbers"),
        (filter.predict_linear(&F, &[1.0, 2.0, 2.0, 1.0]), "Q: expected a symmetric positive"),
        (filter.predict_linear(&[1e308; 4], &Q), "numerical failure: x of set 0"),
        (
            filter.predict(
                |_, next| {
                    next.fill(nan);
                    Ok(())
                },
                None,
            ),
            "transition: expected a function with finite",
        ),
        (filter.sample_gaussian(&[nan; 2], &P0), "mean: expected finite"),
        (filter.sample_gaussian(&[0.0; 3], &P0), "mean: expected 2 values"),
        (filter.sample_gaussian(&[0.0; 2], &[-1.0, 0.0, 0.0, 1.0]), "covariance: expected a symmetric"),
        (filter.set_log_weights(&[f64::NEG_INFINITY; 10]), "log_weights: expected a finite largest value"),
        (filter.resample(Resampling::Systematic, Some(nan), None).map(|_| ()), "threshold: expected a number from 0"),
        (filter.resample(Resampling::Systematic, None, Some(0)).map(|_| ()), "n_particles: expected an integer"),
    ];
    for (result, beginning) in failures {
        let message = result.unwrap_err().to_string();
        assert!(message.starts_with(beginning), "{message}");
    }
    assert_eq!(filter, before);
    filter.x[3] = nan;
    assert!(filter.mean().unwrap_err().to_string().starts_with("x: expected finite numbers"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    #[test]
    fn every_scheme_keeps_the_mean_on_average(seed in 0u64..1000, scheme in 0usize..4) {
        let mut filter = start(1, 3000, seed);
        filter.update(log_normal(1.0)).unwrap();
        let (mean, covariance) = (filter.mean().unwrap(), filter.covariance().unwrap());
        filter.resample(Resampling::ALL[scheme], None, None).unwrap();
        let now = filter.mean().unwrap();
        for i in 0..2 {
            prop_assert!((now[i] - mean[i]).abs() < 5.0 * (covariance[3 * i] / 3000.0).sqrt());
        }
    }
}
