//! The affine-flow dynamical system of one pixel (WO2010/098160, (11)), and the filter's steps over a frame.

use jacoflow::math::random::CounterRng;
use jacoflow::temporal::{FilterForm, FlowFilter, FlowFilterOptions, Transition};
use jacoflow::types::{Frame, SamplingGrid};

/// State `(I, Ix, Iy, Ixx, Ixy, Iyy, u, v, u_x, v_x, u_y, v_y)`.
pub type State = [f64; 12];
type Matrix = [[f64; 12]; 12];

/// `q' = f(q)` of (11): time derivative of the 2-jet under affine flow; the motion's is zero.
fn rate(q: &State) -> State {
    let [_, ix, iy, ixx, ixy, iyy, u, v, u_x, v_x, u_y, v_y] = *q;
    [
        -(ix * u + iy * v),
        -(ixx * u + ixy * v + ix * u_x + iy * v_x),
        -(ixy * u + iyy * v + ix * u_y + iy * v_y),
        -(2.0 * ixx * u_x + 2.0 * ixy * v_x),
        -(ixx * u_y + ixy * (u_x + v_y) + iyy * v_x),
        -(2.0 * ixy * u_y + 2.0 * iyy * v_y),
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
    ]
}

/// One frame of `q' = f(q) + w` by one classical Runge-Kutta step, the drift `w` constant, (54).
pub fn rk4(q: &State, w: &State) -> State {
    let add = |a: &State, s: f64, b: &State| -> State { std::array::from_fn(|k| a[k] + s * b[k]) };
    let slope = |q: &State| add(&rate(q), 1.0, w);
    let k1 = slope(q);
    let k2 = slope(&add(q, 0.5, &k1));
    let k3 = slope(&add(q, 0.5, &k2));
    let k4 = slope(&add(q, 1.0, &k3));
    std::array::from_fn(|k| q[k] + (k1[k] + 2.0 * k2[k] + 2.0 * k3[k] + k4[k]) / 6.0)
}

/// One frame of `q' = f(q)`, by many small steps.
fn exact(q: &State) -> State {
    const STEPS: usize = 64;
    let mut state: State = std::array::from_fn(|k| if k < 6 { q[k] } else { q[k] / STEPS as f64 });
    for _ in 0..STEPS {
        state = rk4(&state, &[0.0; 12]);
    }
    std::array::from_fn(|k| if k < 6 { state[k] } else { q[k] })
}

/// Mean and covariance after one prediction from `q` with variances `p`: the measurement counts for nothing.
fn predicted(transition: Transition, q: State, p: State) -> (State, Matrix) {
    let options = FlowFilterOptions {
        form: FilterForm::Extended,
        transition,
        sites: SamplingGrid::Points(vec![(8, 8)]),
        initial_mean: q,
        initial_covariance: p,
        process_noise: [0.0; 12],
        measurement_noise: 1e15,
        ..FlowFilterOptions::patent()
    };
    let mut filter = FlowFilter::<f64>::new((16, 16), options).unwrap();
    filter.push(&Frame::filled(16, 16, 0.0)).unwrap();
    filter.state(0).unwrap()
}

fn random_state(seed: u64, motion: f64) -> State {
    let rng = CounterRng::new(seed);
    std::array::from_fn(|k| rng.normal(k as u64) * if k < 6 { 3.0 } else { motion })
}

/// `F diag(p) F^T`, F the derivative of `step` at `q` by central differences.
fn carried(step: &dyn Fn(&State) -> State, q: &State, p: &State) -> Matrix {
    let mut f = [[0.0; 12]; 12];
    for column in 0..12 {
        let (mut plus, mut minus) = (*q, *q);
        plus[column] += 1e-5;
        minus[column] -= 1e-5;
        let (a, b) = (step(&plus), step(&minus));
        (0..12).for_each(|row| f[row][column] = (a[row] - b[row]) / 2e-5);
    }
    std::array::from_fn(|a| std::array::from_fn(|b| (0..12).map(|k| f[a][k] * p[k] * f[b][k]).sum()))
}

#[test]
fn each_transition_moves_mean_and_covariance_by_its_own_step_and_derivative() {
    let p: State = std::array::from_fn(|k| 0.5 + 0.1 * k as f64);
    let rk4_step = |q: &State| rk4(q, &[0.0; 12]);
    for seed in 0..10 {
        let q = random_state(seed, 0.4);
        for (transition, step) in
            [(Transition::Rk4, &rk4_step as &dyn Fn(&State) -> State), (Transition::Exact, &exact)]
        {
            let (mean, covariance) = predicted(transition, q, p);
            let (want, spread) = (step(&q), carried(step, &q, &p));
            for a in 0..12 {
                assert!((mean[a] - want[a]).abs() < 1e-6, "{transition:?} {a}: {} {}", mean[a], want[a]);
                for b in 0..12 {
                    let (got, want) = (covariance[a][b], spread[a][b]);
                    assert!((got - want).abs() < 1e-5, "{transition:?} {a} {b}: {got} {want}");
                }
            }
        }
    }
}

#[test]
fn runge_kutta_approaches_the_closed_form_with_fifth_order() {
    let error = |scale: f64| -> f64 {
        let q = random_state(5, scale);
        let (a, b) = (rk4(&q, &[0.0; 12]), predicted(Transition::Exact, q, [1e-3; 12]).0);
        (0..6).map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max)
    };
    let ratio = error(0.2) / error(0.1);
    assert!((25.0..40.0).contains(&ratio), "halving the motion divides the error by 2^5, not {ratio}");
}

#[test]
fn large_motion_keeps_the_closed_form_exact() {
    // A rotation by 2 rad.
    let mut q = [0.0; 12];
    q[1] = 1.0;
    (q[9], q[10]) = (2.0, -2.0);
    let (moved, _) = predicted(Transition::Exact, q, [1e-3; 12]);
    assert!((moved[1] - 2f64.cos()).abs() < 1e-12 && (moved[2] - 2f64.sin()).abs() < 1e-12, "{moved:?}");
}
