//! Exact cases, invariances and extremes.

use super::*;
use crate::math::random::CounterRng;
use crate::mixture::options::CovariancePrior;
use crate::mixture::points::Points;

/// Case D1 of twenty points in the plane, without random numbers: points, weights, responsibilities (20, 3).
fn case_d1() -> (Vec<f64>, Vec<f64>, Vec<f64>) {
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
fn options(rounds: usize) -> DirichletOptions {
    DirichletOptions {
        n_components: 3,
        covariance_prior: CovariancePrior::Isotropic(1.0),
        merge: false,
        max_iter: rounds,
        tol: None,
        ..DirichletOptions::default()
    }
}

fn assert_near(got: &[f64], want: &[f64], tolerance: f64) {
    assert_eq!(got.len(), want.len());
    for (got, want) in got.iter().zip(want) {
        assert!((got - want).abs() <= tolerance, "{got} is not {want}");
    }
}

/// Case D1 with other options.
fn d1(options: &DirichletOptions) -> DirichletMixture {
    let (x, w, r) = case_d1();
    fit_dirichlet_from(&Points { dimensions: 2, values: &x, weights: Some(&w) }, options, &r).unwrap()
}

#[test]
fn concentration_and_inference_of_case_d1() {
    let half = d1(&DirichletOptions { weight_concentration: 0.5, ..options(50) });
    assert_near(&half.weights, &[0.504_201_680_7, 0.272_430_545_0, 0.223_367_774_3], 1e-9);

    // Of variational Bayes the expectations of the logarithms are published: they are those of the counts.
    let five = d1(&DirichletOptions { inference: Inference::Vb, ..options(5) });
    let logs = sticks::log_proportions(&five.counts, 1.0, Inference::Vb);
    let proportions: Vec<f64> = logs.iter().map(|log| log.exp()).collect();
    assert_near(&proportions, &[0.444_085_478_3, 0.302_767_529_2, 0.222_411_085_4], 1e-9);
}

#[test]
fn hard_divisions_have_their_exact_score() {
    let (x, w, _) = case_d1();
    let points = Points { dimensions: 2, values: &x, weights: Some(&w) };
    let score = |k: usize, label: fn(usize) -> usize| {
        let options = DirichletOptions { n_components: k, ..options(1) };
        let problem = em::Problem::new(&points, &options).unwrap();
        let labels: Vec<usize> = (0..20).map(label).collect();
        let start = crate::mixture::start::from_labels(&points, &problem.planes.centre, k, &labels);
        problem.scorer.score(&start.moments, start.negentropy).unwrap()
    };
    assert_near(&[score(1, |_| 0), score(2, |n| n % 2)], &[-219.655_393_200_6, -97.525_072_635_4], 1e-9);
}

/// Points about `centres` places, whole weights.
fn clusters(count: usize, dimensions: usize, centres: u64, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let rng = CounterRng::new(seed);
    let centre = |n: usize, d: usize| 8.0 * rng.stream(n as u64 % centres).normal(d as u64);
    let x = (0..count * dimensions).map(|i| centre(i / dimensions, i % dimensions) + rng.normal(i as u64)).collect();
    let w = (0..count).map(|n| (rng.bits(n as u64) % 4) as f64).collect();
    (x, w)
}

/// What pooling does to F when the responsibilities are held, from the definition: the oracle of the sums
/// behind it.
#[test]
fn gains_of_pairs_are_differences_of_the_score() {
    let (x, w) = clusters(200, 2, 3, 2);
    let points = Points { dimensions: 2, values: &x, weights: Some(&w) };
    let options = DirichletOptions { n_components: 5, weight_concentration: 0.7, max_iter: 6, ..options(6) };
    let problem = em::Problem::new(&points, &options).unwrap();
    let labels: Vec<usize> = (0..200).map(|n| n % 5).collect();
    let start = crate::mixture::start::from_labels(&points, &problem.planes.centre, 5, &labels);
    let run = problem.run(start.moments).unwrap();
    let centred: Vec<f64> = x.iter().enumerate().map(|(at, x)| x - problem.planes.centre[at % 2]).collect();
    let (_, rows) = run.densities.log_densities(&Points { dimensions: 2, values: &centred, weights: None });
    let score = |rows: &[f64]| {
        let start = crate::mixture::start::from_shares(&points, &problem.planes.centre, 5, rows).unwrap();
        problem.scorer.score(&start.moments, start.negentropy).unwrap()
    };
    let mut want: Vec<(f64, (usize, usize))> = vec![];
    for i in 0..5 {
        for j in i + 1..5 {
            let mut pooled = rows.clone();
            for row in pooled.chunks_exact_mut(5) {
                row[i] += row[j];
                row[j] = 0.0;
            }
            want.push((score(&pooled) - score(&rows), (i, j)));
        }
    }
    want.sort_by(|a, b| b.0.total_cmp(&a.0));
    let got = merge::candidates(&problem, &run).unwrap();
    assert_near(&[run.score], &[score(&rows)], 1e-9 * run.score.abs());
    assert!(!got.is_empty());
    for (got, want) in got.iter().zip(&want) {
        assert_eq!(got.1, want.1);
        assert_near(&[got.0], &[want.0], 1e-9 * run.score.abs());
    }
    let tried = want.iter().filter(|(gain, _)| *gain >= -20.0).count().min(3);
    assert_eq!(got.len(), tried);
}
