//! Resampling (selection): particles are copied in proportion to their weights.

use jacoflow::filter::particle::{Resampling, resample_indices};
use jacoflow::math::random::CounterRng;
use proptest::prelude::*;

const WEIGHTS: [f64; 4] = [0.1, 0.2, 0.3, 0.4];

fn select(scheme: Resampling, weights: &[f64], count: usize, uniforms: &[f64]) -> Vec<usize> {
    let mut out = vec![9];
    resample_indices(scheme, weights, count, |i| uniforms[i as usize], &mut out);
    out
}

/// The first particle with a positive weight whose cumulative weight reaches `target`.
fn naive(weights: &[f64], target: f64) -> usize {
    let mut sum = 0.0;
    for (i, weight) in weights.iter().enumerate() {
        sum += weight;
        if sum >= target && *weight > 0.0 {
            return i;
        }
    }
    weights.iter().rposition(|weight| *weight > 0.0).unwrap()
}

#[test]
fn systematic_case_without_random_numbers() {
    assert_eq!(select(Resampling::Systematic, &WEIGHTS, 8, &[0.3]), [0, 1, 1, 2, 2, 3, 3, 3]);
}

#[test]
fn residual_copies_the_whole_part_and_draws_the_rest() {
    // Expected copies 0.8, 1.6, 2.4, 3.2: remainders 0.8, 0.6, 0.4, 0.2 of 2 draws.
    assert_eq!(select(Resampling::Residual, &WEIGHTS, 8, &[0.95, 0.1]), [1, 2, 2, 3, 3, 3, 3, 0]);
    // Halves are exact in binary: no draw is left.
    assert_eq!(select(Resampling::Residual, &[0.25, 0.5, 0.25], 4, &[]), [0, 1, 1, 2]);
}

#[test]
fn zero_weights_are_never_selected() {
    let weights = [0.0, 0.5, f64::NAN, 0.0, 0.5, -1.0, 0.0];
    for scheme in Resampling::ALL {
        for u in [0.0, 0.5, 1.0 - f64::EPSILON / 2.0, 1.0] {
            let indices = select(scheme, &weights, 6, &[u; 6]);
            assert!(indices.len() == 6 && indices.iter().all(|i| [1, 4].contains(i)), "{} {indices:?}", scheme.name());
        }
        assert!(select(scheme, &[0.0, f64::NAN], 3, &[0.5; 3]).is_empty());
        assert!(select(scheme, &[], 3, &[0.5; 3]).is_empty() && select(scheme, &[1.0], 0, &[0.5]).is_empty());
    }
}

#[test]
fn names_are_read_back() {
    for scheme in Resampling::ALL {
        assert_eq!(Resampling::parse(scheme.name()).unwrap(), scheme);
    }
    let message = Resampling::parse("fair").unwrap_err().to_string();
    assert!(message.starts_with("resampling: expected one of multinomial, ") && message.ends_with("\"fair\""));
}

proptest! {
    #[test]
    fn positions_select_as_the_naive_search_does(
        weights in prop::collection::vec(prop_oneof![Just(0.0), 0.01f64..1.0], 1..30),
        uniforms in prop::collection::vec(0.0f64..1.0, 50),
        count in 1usize..50,
    ) {
        let total: f64 = weights.iter().sum();
        prop_assume!(total > 0.0);
        for (i, j) in select(Resampling::Multinomial, &weights, count, &uniforms).into_iter().enumerate() {
            prop_assert_eq!(j, naive(&weights, uniforms[i] * total));
        }
        for (i, j) in select(Resampling::Stratified, &weights, count, &uniforms).into_iter().enumerate() {
            prop_assert_eq!(j, naive(&weights, (i as f64 + uniforms[i]) / count as f64 * total));
        }
        for (i, j) in select(Resampling::Systematic, &weights, count, &uniforms).into_iter().enumerate() {
            prop_assert_eq!(j, naive(&weights, (i as f64 + uniforms[0]) / count as f64 * total));
        }
    }

    #[test]
    fn systematic_and_residual_copies_are_near_their_expectation(
        weights in prop::collection::vec(0.0f64..1.0, 1..30), count in 1usize..60, seed in 0u64..1000
    ) {
        let total: f64 = weights.iter().sum();
        prop_assume!(total > 0.0);
        for scheme in [Resampling::Systematic, Resampling::Residual] {
            let mut out = vec![];
            scheme.indices(&weights, count, &CounterRng::new(seed), &mut out);
            prop_assert_eq!(out.len(), count);
            for (i, weight) in weights.iter().enumerate() {
                let (copies, expected) = (out.iter().filter(|&&j| j == i).count() as f64, count as f64 * weight / total);
                prop_assert!(copies > expected - 1.0 - 1e-9);
                prop_assert!(scheme != Resampling::Systematic || copies < expected + 1.0 + 1e-9);
            }
        }
    }
}

#[test]
fn copies_have_the_published_mean_and_variance() {
    let published = [
        (Resampling::Multinomial, [0.72, 1.28, 1.68, 1.92]),
        (Resampling::Stratified, [0.16, 0.40, 0.40, 0.16]),
        (Resampling::Systematic, [0.16, 0.24, 0.24, 0.16]),
        // Two draws from the remainders (.8, .6, .4, .2) / 2: variance 2 p (1 - p).
        (Resampling::Residual, [0.48, 0.42, 0.32, 0.18]),
    ];
    const DRAWS: u64 = 20_000;
    for (scheme, variances) in published {
        let (mut sums, mut squares, mut out) = ([0.0; 4], [0.0; 4], vec![]);
        for draw in 0..DRAWS {
            scheme.indices(&WEIGHTS, 8, &CounterRng::new(3).stream(draw), &mut out);
            for i in 0..4 {
                let copies = out.iter().filter(|&&j| j == i).count() as f64;
                sums[i] += copies;
                squares[i] += copies * copies;
            }
        }
        for i in 0..4 {
            let mean = sums[i] / DRAWS as f64;
            let variance = squares[i] / DRAWS as f64 - mean * mean;
            assert!((mean - 8.0 * WEIGHTS[i]).abs() < 0.02, "{}: mean {mean} of {i}", scheme.name());
            assert!((variance - variances[i]).abs() < 0.05, "{}: variance {variance} of {i}", scheme.name());
        }
    }
}
