//! The affine-flow dynamical system of one pixel (WO2010/098160, (11)), its step over one frame, and the

use jacoflow::math::random::CounterRng;
use jacoflow::temporal::dynamics::{Matrix, State, exact, exact_jacobian, rate, rate_jacobian, rk4, rk4_jacobian};

fn random_state(seed: u64, motion: f64) -> State {
    let rng = CounterRng::new(seed);
    std::array::from_fn(|k| rng.normal(k as u64) * if k < 6 { 3.0 } else { motion })
}

fn differences(f: &dyn Fn(&State) -> State, q: &State) -> Matrix {
    let mut out = [[0.0; 12]; 12];
    for column in 0..12 {
        let (mut plus, mut minus) = (*q, *q);
        plus[column] += 1e-5;
        minus[column] -= 1e-5;
        let (a, b) = (f(&plus), f(&minus));
        for row in 0..12 {
            out[row][column] = (a[row] - b[row]) / 2e-5;
        }
    }
    out
}

fn largest_difference(a: &Matrix, b: &Matrix) -> f64 {
    a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn jacobians_are_the_derivatives() {
    for seed in 0..20 {
        let q = random_state(seed, 0.4);
        assert!(largest_difference(&rate_jacobian(&q), &differences(&rate, &q)) < 1e-8);
        assert!(largest_difference(&rk4_jacobian(&q), &differences(&|q| rk4(q, &[0.0; 12]), &q)) < 1e-7);
        assert!(largest_difference(&exact_jacobian(&q), &differences(&exact, &q)) < 1e-7);
    }
}

#[test]
fn brightness_moves_with_the_flow() {
    // After the step, the brightness at p is the old one at the place from which the flow carried it to
    // p: follow many small exact steps.
    let q = random_state(3, 0.5);
    let fine = {
        let mut state = q;
        let n = 64;
        for k in 6..12 {
            state[k] /= f64::from(n);
        }
        for _ in 0..n {
            state = rk4(&state, &[0.0; 12]);
        }
        state
    };
    let closed = exact(&q);
    for k in 0..6 {
        assert!((closed[k] - fine[k]).abs() < 1e-7, "{k}: {} {}", closed[k], fine[k]);
    }
}

#[test]
fn runge_kutta_approaches_the_closed_form_with_fifth_order() {
    let error = |scale: f64| -> f64 {
        let q = random_state(5, scale);
        let (a, b) = (rk4(&q, &[0.0; 12]), exact(&q));
        (0..6).map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max)
    };
    let ratio = error(0.2) / error(0.1);
    assert!((25.0..40.0).contains(&ratio), "halving the motion divides the error by 2^5, not {ratio}");
    assert!(error(0.01) < 1e-8);
}

#[test]
fn large_motion_keeps_the_closed_form_exact() {
    // A rotation by 2 rad: E is the rotation matrix.
    let mut q = [0.0; 12];
    q[1] = 1.0;
    (q[9], q[10]) = (2.0, -2.0);
    let moved = exact(&q);
    assert!((moved[1] - 2f64.cos()).abs() < 1e-12 && (moved[2] - 2f64.sin()).abs() < 1e-12, "{moved:?}");
}
