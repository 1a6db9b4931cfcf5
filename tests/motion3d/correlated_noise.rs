//! Errors that go together over a distance.

use super::scenes::{ELLIPSOID, mahalanobis};
use jacoflow::math::random::CounterRng;
use jacoflow::motion3d::*;
use nalgebra::{DMatrix, DVector};

const SIDE: usize = 14;
const SPACING: f64 = 0.08;
const LENGTH: f64 = 0.03;
const SIGMA: f64 = 0.01;

fn points() -> Vec<[f64; 2]> {
    let middle = 0.5 * (SIDE - 1) as f64;
    (0..SIDE * SIDE).map(|k| [(k % SIDE) as f64, (k / SIDE) as f64].map(|at| SPACING * (at - middle))).collect()
}

/// A factor of the correlations of errors at these points.
fn factor(points: &[[f64; 2]]) -> DMatrix<f64> {
    let n = points.len();
    let rho = |i: usize, j: usize| {
        let d = (points[i][0] - points[j][0]).hypot(points[i][1] - points[j][1]) / LENGTH;
        0.4 * (-0.25 * d * d).exp() + 0.6 * (-d / 3.75).exp()
    };
    DMatrix::from_fn(n, n, rho).cholesky().unwrap().l()
}

fn coverage() -> (f64, f64) {
    let motion = Motion::new([0.3, 0.1, 0.9], [0.02, -0.03, 0.01]);
    let points = points();
    let factor = factor(&points);
    let trials = 200;
    let (mut inside, mut sum) = (0, 0.0);
    for seed in 0..trials {
        let rng = CounterRng::new(3000 + seed);
        let noise = [0, 1].map(|j| &factor * DVector::from_fn(points.len(), |k, _| rng.normal((2 * k + j) as u64)));
        let at = |k: usize| {
            let exact =
                motion.plane_flow(points[k], 1.0 + 0.5 * (3.0 * points[k][0]).sin() * (2.0 * points[k][1]).cos());
            [exact[0] + SIGMA * noise[0][k], exact[1] + SIGMA * noise[1][k]]
        };
        let flow: Vec<[f64; 2]> = (0..points.len()).map(at).collect();
        let options =
            MotionOptions { placement: Placement::Start, correlation_length: Some(LENGTH), ..MotionOptions::default() };
        let given = Flow::Plane { points: &points, flow: &flow, camera: None };
        let found = estimate_motion(&given, &Noise::StandardDeviation(SIGMA), &options).unwrap();
        let square = mahalanobis(&found, &motion);
        inside += u32::from(square < ELLIPSOID);
        sum += square / 5.0;
    }
    (f64::from(inside) / trials as f64, sum / trials as f64)
}

#[test]
fn the_covariance_holds_where_errors_go_together() {
    let (share, mean) = coverage();
    assert!((0.88..=0.97).contains(&share) && (0.6..1.25).contains(&mean), "{share} {mean}");
}

#[test]
fn it_is_no_smaller_than_that_of_independent_points() {
    let motion = Motion::new([0.3, 0.1, 0.9], [0.02, -0.03, 0.01]);
    let points = points();
    let flow: Vec<[f64; 2]> = points.iter().map(|&at| motion.plane_flow(at, 1.0 + at[0] * at[1])).collect();
    let given = Flow::Plane { points: &points, flow: &flow, camera: None };
    let told = |length, points_per_independent_sample| {
        let options = MotionOptions {
            placement: Placement::Start,
            correlation_length: length,
            points_per_independent_sample,
            ..MotionOptions::default()
        };
        estimate_motion(&given, &Noise::StandardDeviation(SIGMA), &options).unwrap().direction_std
    };
    let alone = told(None, None);
    assert_eq!(told(Some(0.0), None), alone);
    assert!((told(Some(1e-6), None) - alone).abs() < 1e-9 * alone);
    assert!(told(Some(LENGTH), None) > 1.1 * alone);
    // Noise already given for many that share one error covers it.
    assert!((told(Some(LENGTH), Some(500.0)) - told(None, Some(500.0))).abs() < 1e-9 * alone);
    let wrong = MotionOptions { correlation_length: Some(-1.0), ..MotionOptions::default() };
    let error = estimate_motion(&given, &Noise::StandardDeviation(SIGMA), &wrong).unwrap_err().to_string();
    assert!(error.starts_with("correlation_length: "), "{error}");
}
