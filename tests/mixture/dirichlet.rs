//! Exact cases, invariances and extremes.

use super::cases::{assert_near, case_d1, clusters, options};
use jacoflow::math::random::CounterRng;
use jacoflow::mixture::{
    CovariancePrior, DirichletMixture, DirichletOptions, Inference, Points, fit_dirichlet, fit_dirichlet_from,
};
use jacoflow::parallel::Threads;

/// Case D1 with other options.
fn d1(options: &DirichletOptions) -> DirichletMixture {
    let (x, w, r) = case_d1();
    fit_dirichlet_from(&Points { dimensions: 2, values: &x, weights: Some(&w) }, options, &r).unwrap()
}

#[test]
fn case_d1_has_its_published_figures() {
    let one = d1(&options(1));
    assert_near(&one.weights, &[0.372_619_047_6, 0.314_285_714_3, 0.313_095_238_1], 1e-9);
    assert_near(&one.means[..2], &[0.207_655_743_3, 0.549_303_724_6], 1e-9);
    let [xx, xy, yy] = [0, 1, 3].map(|at| one.covariances[at]);
    assert_near(&[xx, xy, yy], &[8.304_617_046_8, 1.259_068_652_3, 0.413_569_300_4], 1e-9);
    assert_near(&[one.lower_bound], &[-252.482_663_656_7], 1e-9);
    let (x, w, _) = case_d1();
    let (logs, _) = one.log_densities(&Points { dimensions: 2, values: &x, weights: None }).unwrap();
    let likelihood: f64 = logs.iter().zip(&w).map(|(log, w)| w * log).sum();
    assert_near(&[likelihood], &[-202.968_331_173_4], 1e-9);

    let five = d1(&options(5));
    assert_near(&five.weights, &[0.373_641_412_6, 0.318_920_006_7, 0.307_438_580_6], 1e-9);
    assert_near(&[five.lower_bound], &[-251.104_797_753_5], 1e-9);

    let fifty = d1(&options(50));
    assert_near(&fifty.counts, &[30.0, 16.057_621_094_8, 13.942_378_905_2], 1e-9);
    assert_near(&fifty.means[..2], &[3.345_230_331_5, 1.027_437_120_3], 1e-9);
    assert_near(&[fifty.lower_bound], &[-110.868_222_661_9], 1e-9);
    let half = d1(&DirichletOptions { weight_concentration: 0.5, ..options(50) });
    assert_near(&half.weights, &[0.504_201_680_7, 0.272_430_545_0, 0.223_367_774_3], 1e-9);
}

#[test]
fn merging_of_case_d1() {
    let merged = d1(&DirichletOptions { merge: true, ..options(50) });
    assert_near(&merged.counts, &[30.0, 30.0, 0.0], 1e-9);
    assert_near(&merged.means[2..4], &[-3.342_932_669_4, -0.030_359_543_6], 1e-9);
    assert_near(&[merged.lower_bound], &[-100.959_059_839_9], 1e-9);
    assert_eq!(merged.n_active(), 2);
}

#[test]
fn three_points_have_their_exact_evidence() {
    let points = Points { dimensions: 2, values: &[0.0, 0.0, 1.0, 0.0, 0.0, 2.0], weights: Some(&[1.0, 2.0, 0.5]) };
    let options = DirichletOptions { n_components: 1, covariance_floor: 0.0, ..options(1) };
    let mixture = fit_dirichlet_from(&points, &options, &[1.0; 3]).unwrap();
    // Psi = (nu + D + 2) Sigma with nu = D + 2 + F.
    let psi: Vec<f64> = mixture.covariances.iter().map(|value| (4.0 + 3.5 + 4.0) * value).collect();
    assert_near(&psi, &[1.857_142_857_1, -0.571_428_571_4, -0.571_428_571_4, 2.714_285_714_3], 1e-9);
    assert_near(&[mixture.lower_bound], &[-13.138_681_373_1], 1e-9);
}

#[test]
fn weights_are_repetitions() {
    for inference in [Inference::Map, Inference::Vb] {
        for dimensions in [1, 2, 3, 7] {
            let (x, w) = clusters(300, dimensions, 4, 3);
            let repeated: Vec<f64> = x.chunks(dimensions).zip(&w).flat_map(|(x, w)| x.repeat(*w as usize)).collect();
            let options = DirichletOptions { inference, ..DirichletOptions::default() };
            let weighted = Points { dimensions, values: &x, weights: Some(&w) };
            let repeated = Points { dimensions, values: &repeated, weights: None };
            let [a, b] = [weighted, repeated].map(|points| fit_dirichlet(&points, &options).unwrap());
            assert_eq!(a.n_iter, b.n_iter);
            assert_near(&a.means, &b.means, 1e-12 * 30.0);
            assert_near(&[a.lower_bound], &[b.lower_bound], 1e-11 * b.lower_bound.abs());
        }
    }
}

#[test]
fn threads_and_order_make_no_difference() {
    let (x, w) = clusters(3000, 2, 5, 5);
    let points = Points { dimensions: 2, values: &x, weights: Some(&w) };
    let usual = fit_dirichlet(&points, &DirichletOptions::default()).unwrap();
    for threads in [1, 2, 3] {
        let options = DirichletOptions { threads: Threads::new(Some(threads)).unwrap(), ..DirichletOptions::default() };
        assert_eq!(fit_dirichlet(&points, &options).unwrap(), usual);
    }
    let x: Vec<f64> = x.chunks(2).rev().flatten().copied().collect();
    let w: Vec<f64> = w.iter().rev().copied().collect();
    let other = fit_dirichlet(&Points { dimensions: 2, values: &x, weights: Some(&w) }, &DirichletOptions::default());
    let other = other.unwrap();
    assert_near(&other.means, &usual.means, 1e-9);
    assert_near(&other.weights, &usual.weights, 1e-9);
}

#[test]
fn merging_only_raises_the_score_and_more_starts_do() {
    let (x, w) = clusters(400, 2, 5, 11);
    let points = Points { dimensions: 2, values: &x, weights: Some(&w) };
    let score = |options: &DirichletOptions| fit_dirichlet(&points, options).unwrap().lower_bound;
    for seed in 0..5 {
        let options = DirichletOptions { random_state: seed, ..DirichletOptions::default() };
        let plain = DirichletOptions { merge: false, ..options.clone() };
        assert!(score(&options) > score(&plain));
        assert!(score(&DirichletOptions { n_init: 4, ..plain.clone() }) >= score(&plain));
    }
}

#[test]
fn merging_puts_one_gaussian_together() {
    for seed in 0..10 {
        let rng = CounterRng::new(seed);
        let x: Vec<f64> = (0..800).map(|i| rng.normal(i)).collect();
        let points = Points { dimensions: 2, values: &x, weights: None };
        let mixture =
            fit_dirichlet(&points, &DirichletOptions { random_state: seed, ..DirichletOptions::default() }).unwrap();
        assert_near(&mixture.counts[..2], &[400.0, 0.0], 1e-9);
    }
}

#[test]
fn degenerate_points_are_legal() {
    let line: Vec<f64> = (0..40).flat_map(|n| [f64::from(n), 2.0 * f64::from(n)]).collect();
    let cases: [(&[f64], usize); 5] =
        [(&[1.0, 2.0], 2), (&[4.0; 60], 3), (&line, 2), (&[0.0, 1e6, -1e6], 1), (&[0.0; 7], 7)];
    for inference in [Inference::Map, Inference::Vb] {
        for weight_concentration in [0.3, 1.0, 4.0] {
            for (values, dimensions) in cases {
                for n_components in [1, 12] {
                    let options = DirichletOptions {
                        n_components,
                        weight_concentration,
                        inference,
                        ..DirichletOptions::default()
                    };
                    let points = Points { dimensions, values, weights: None };
                    let mixture = fit_dirichlet(&points, &options).unwrap();
                    let numbers = mixture.weights.iter().chain(&mixture.means).chain(&mixture.covariances);
                    assert!(numbers.chain([&mixture.lower_bound]).all(|value| value.is_finite()));
                    assert_near(&[mixture.weights.iter().sum()], &[1.0], 1e-12);
                    let (logs, shares) = mixture.log_densities(&points).unwrap();
                    assert!(logs.iter().chain(&shares).all(|value| value.is_finite()));
                }
            }
        }
    }
}

#[test]
fn points_of_weight_zero_are_ignored() {
    let (x, _) = clusters(200, 2, 3, 7);
    let far: Vec<f64> = x.iter().copied().chain([1e5, -1e5]).collect();
    let weights: Vec<f64> = (0..=200).map(|n| f64::from(u8::from(n < 200))).collect();
    let options = DirichletOptions::default();
    let with = fit_dirichlet(&Points { dimensions: 2, values: &far, weights: Some(&weights) }, &options).unwrap();
    let without = fit_dirichlet(&Points { dimensions: 2, values: &x, weights: None }, &options).unwrap();
    assert_near(&with.means, &without.means, 1e-10);
    assert_near(&[with.lower_bound], &[without.lower_bound], 1e-8);
}

#[test]
fn what_cannot_be_used_is_named() {
    let points = Points { dimensions: 2, values: &[0.0, 1.0, 2.0, 3.0], weights: None };
    let usual = DirichletOptions::default();
    let named = |points: &Points, options: &DirichletOptions, name: &str| {
        let error = fit_dirichlet(points, options).unwrap_err().to_string();
        assert!(error.starts_with(&format!("{name}: ")), "{error}");
    };
    for (name, options) in [
        ("n_components", DirichletOptions { n_components: 0, ..usual.clone() }),
        ("n_components", DirichletOptions { n_components: usize::MAX, ..usual.clone() }),
        ("n_init", DirichletOptions { n_init: 0, ..usual.clone() }),
        ("max_iter", DirichletOptions { max_iter: 0, ..usual.clone() }),
        ("weight_concentration", DirichletOptions { weight_concentration: 0.0, ..usual.clone() }),
        ("mean_precision", DirichletOptions { mean_precision: f64::NAN, ..usual.clone() }),
        ("degrees_of_freedom", DirichletOptions { degrees_of_freedom: Some(1.0), ..usual.clone() }),
        ("covariance_prior", DirichletOptions { covariance_prior: CovariancePrior::Isotropic(-1.0), ..usual.clone() }),
        ("covariance_floor", DirichletOptions { covariance_floor: -1.0, ..usual.clone() }),
        ("tol", DirichletOptions { tol: Some(f64::INFINITY), ..usual.clone() }),
    ] {
        named(&points, &options, name);
    }
    for (name, points) in [
        ("X", Points { values: &[], ..points }),
        ("X", Points { values: &[0.0, f64::NAN], ..points }),
        ("sample_weight", Points { weights: Some(&[1.0]), ..points }),
        ("sample_weight", Points { weights: Some(&[1.0, -1.0]), ..points }),
        ("sample_weight", Points { weights: Some(&[0.0, 0.0]), ..points }),
    ] {
        named(&points, &usual, name);
    }
    for resp in [&[0.5; 3][..], &[0.7; 4], &[2.0, -1.0, 0.0, 1.0]] {
        let two = DirichletOptions { n_components: 2, ..usual.clone() };
        let error = fit_dirichlet_from(&points, &two, resp).unwrap_err().to_string();
        assert!(error.starts_with("resp: "), "{error}");
    }
    let mixture = fit_dirichlet(&points, &usual).unwrap();
    let error = mixture.log_densities(&Points { dimensions: 1, ..points }).unwrap_err().to_string();
    assert!(error.starts_with("X: "), "{error}");
}
