//! Small dense least squares against a general decomposition.

use jacoflow::flow::least_squares::solve;
use jacoflow::math::random::CounterRng;
use nalgebra::{SMatrix, SVector};

fn random<const N: usize, const P: usize>(seed: u64) -> ([[f64; P]; N], [f64; N]) {
    let rng = CounterRng::new(seed);
    let a = std::array::from_fn(|i| std::array::from_fn(|j| rng.normal((i * P + j) as u64)));
    (a, std::array::from_fn(|i| rng.normal(1000 + i as u64)))
}

#[test]
fn agrees_with_a_general_decomposition() {
    for seed in 0..50 {
        let (mut a, b) = random::<12, 6>(seed);
        // Columns of very different length, and every other time a near dependence.
        for row in &mut a {
            row[2] *= 1e4;
            row[5] = if seed % 2 == 0 { row[0] + 1e-3 * row[5] } else { row[5] };
        }
        let matrix = SMatrix::<f64, 12, 6>::from_fn(|i, j| a[i][j]);
        let want = matrix.svd(true, true).solve(&SVector::from(b), 1e-14).unwrap();
        let got = solve(&a, &b, 0.0);
        assert_eq!(got.rank, 6);
        for k in 0..6 {
            assert!((got.x[k] - want[k]).abs() < 1e-9 * (1.0 + want.norm()), "{seed} {k}");
        }
        let residual = (matrix * want - SVector::from(b)).norm_squared();
        assert!((got.residual_square - residual).abs() < 1e-9);
    }
}

#[test]
fn deficient_systems_get_the_solution_of_least_norm() {
    let (mut a, b) = random::<6, 4>(3);
    for row in &mut a {
        row[3] = 2.0 * row[1] - row[0];
    }
    let got = solve(&a, &b, 0.0);
    assert_eq!(got.rank, 3);
    let matrix = SMatrix::<f64, 6, 4>::from_fn(|i, j| a[i][j]);
    let want = matrix.svd(true, true).solve(&SVector::from(b), 1e-10).unwrap();
    for k in 0..4 {
        assert!((got.x[k] - want[k]).abs() < 1e-10);
    }
    let zero = solve(&[[0.0; 4]; 6], &b, 0.0);
    assert!(zero.rank == 0 && zero.x == [0.0; 4] && zero.condition.is_infinite());
}

#[test]
fn rank_ignores_gain_and_column_scale_but_sees_rounding_noise() {
    let (mut a, b) = random::<6, 2>(9);
    for row in &mut a {
        row[1] = row[0] * (1.0 + 1e-6 * row[1]);
    }
    for gain in [1e-8, 1.0, 1e8] {
        let scaled = a.map(|row| [row[0] * gain, row[1] * gain * 1e3]);
        assert_eq!(solve(&scaled, &b, 0.0).rank, 2);
        assert_eq!(solve(&scaled, &b, 1e-5 * gain).rank, 1);
    }
}

#[test]
fn square_systems_are_solved_exactly() {
    let got = solve(&[[2.0, 1.0], [1.0, 3.0]], &[5.0, 10.0], 0.0);
    assert!((got.x[0] - 1.0).abs() < 1e-14 && (got.x[1] - 3.0).abs() < 1e-14 && got.residual_square < 1e-28);
}
