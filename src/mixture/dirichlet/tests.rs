//! Exact cases, invariances and extremes.

use super::*;
use crate::{math, mixture};
use cases::{assert_near, case_d1, clusters, options};
use mixture::points::Points;

#[path = "../../../tests/mixture/cases.rs"]
mod cases;

/// Of variational Bayes the expectations of the logarithms are published: they are those of the counts.
#[test]
fn variational_proportions_of_case_d1() {
    let (x, w, r) = case_d1();
    let points = Points { dimensions: 2, values: &x, weights: Some(&w) };
    let five = fit_dirichlet_from(&points, &DirichletOptions { inference: Inference::Vb, ..options(5) }, &r).unwrap();
    let logs = sticks::log_proportions(&five.counts, 1.0, Inference::Vb);
    let proportions: Vec<f64> = logs.iter().map(|log| log.exp()).collect();
    assert_near(&proportions, &[0.444_085_478_3, 0.302_767_529_2, 0.222_411_085_4], 1e-9);
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
