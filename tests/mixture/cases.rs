//! Points of the tests of Dirichlet-process mixtures.

use super::math::random::CounterRng;
use super::mixture::{CovariancePrior, DirichletOptions};

/// Case D1 of twenty points in the plane, without random numbers: points, weights, responsibilities (20, 3).
pub(crate) fn case_d1() -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let (mut x, mut w, mut r) = (vec![], vec![], vec![]);
    for n in 0..20 {
        let (at, odd) = (f64::from(n), f64::from(n % 2));
        x.extend([6.0 * odd - 3.0 + 0.5 * (3.0 * at).sin(), odd + 0.7 * (2.0 * at).cos()]);
        w.push(f64::from(1 + 7 * n % 5));
        let row = [0, 1, 2].map(|k| f64::from(1 + (n + 2 * k) % 3) + if k == 1 { odd } else { 0.0 });
        r.extend(row.map(|value| value / row.iter().sum::<f64>()));
    }
    (x, w, r)
}

/// Options of case D1: `S0 = I`, no merging, exactly `rounds` rounds.
pub(crate) fn options(rounds: usize) -> DirichletOptions {
    DirichletOptions {
        n_components: 3,
        covariance_prior: CovariancePrior::Isotropic(1.0),
        merge: false,
        max_iter: rounds,
        tol: None,
        ..DirichletOptions::default()
    }
}

pub(crate) fn assert_near(got: &[f64], want: &[f64], tolerance: f64) {
    assert_eq!(got.len(), want.len());
    for (got, want) in got.iter().zip(want) {
        assert!((got - want).abs() <= tolerance, "{got} is not {want}");
    }
}

/// Points about `centres` places, whole weights.
pub(crate) fn clusters(count: usize, dimensions: usize, centres: u64, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let rng = CounterRng::new(seed);
    let centre = |n: usize, d: usize| 8.0 * rng.stream(n as u64 % centres).normal(d as u64);
    let x = (0..count * dimensions).map(|i| centre(i / dimensions, i % dimensions) + rng.normal(i as u64)).collect();
    let w = (0..count).map(|n| (rng.bits(n as u64) % 4) as f64).collect();
    (x, w)
}
