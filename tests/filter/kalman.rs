//! Kalman filters against each other, against statistics, and against numbers recorded from filterpy
//! (`tests/golden/filters.py`).

#![allow(clippy::unnecessary_wraps, reason = "models of a state space may fail")]

use jacoflow::error::{Error, Result};
use jacoflow::filter::{ExtendedFilter, GaussianState, KalmanFilter, SigmaPoints, UnscentedFilter};
use jacoflow::math::random::CounterRng;
use nalgebra::{DMatrix, DVector};

const Q: [f64; 4] = [1e-3, 1e-3, 1e-2, 1e-3];

const R: [f64; 2] = [0.04, 1e-3];

const X0: [f64; 4] = [3.0, 4.0, 1.0, 0.3];

const P0: [f64; 4] = [0.5, 0.5, 0.2, 0.1];

fn diagonal(values: &[f64]) -> Vec<f64> {
    let n = values.len();
    (0..n * n).map(|k| if k % (n + 1) == 0 { values[k / (n + 1)] } else { 0.0 }).collect()
}

/// Constant speed and heading, over half a second; rows of (x, y, speed, heading).
fn travel(points: &[f64], out: &mut [f64]) -> Result<()> {
    for (p, q) in points.chunks_exact(4).zip(out.chunks_exact_mut(4)) {
        q.copy_from_slice(&[p[0] + 0.5 * p[2] * p[3].cos(), p[1] + 0.5 * p[2] * p[3].sin(), p[2], p[3]]);
    }
    Ok(())
}

fn travel_jacobian(means: &[f64], out: &mut [f64]) -> Result<()> {
    for (p, f) in means.chunks_exact(4).zip(out.chunks_exact_mut(16)) {
        f.copy_from_slice(&diagonal(&[1.0; 4]));
        (f[2], f[3]) = (0.5 * p[3].cos(), -0.5 * p[2] * p[3].sin());
        (f[6], f[7]) = (0.5 * p[3].sin(), 0.5 * p[2] * p[3].cos());
    }
    Ok(())
}

/// Range and bearing from the origin.
fn sight(points: &[f64], out: &mut [f64]) -> Result<()> {
    for (p, z) in points.chunks_exact(4).zip(out.chunks_exact_mut(2)) {
        z.copy_from_slice(&[p[0].hypot(p[1]), p[1].atan2(p[0])]);
    }
    Ok(())
}

fn sight_jacobian(means: &[f64], out: &mut [f64]) -> Result<()> {
    for (p, h) in means.chunks_exact(4).zip(out.chunks_exact_mut(8)) {
        let square = p[0] * p[0] + p[1] * p[1];
        let range = square.sqrt();
        h.copy_from_slice(&[p[0] / range, p[1] / range, 0.0, 0.0, -p[1] / square, p[0] / square, 0.0, 0.0]);
    }
    Ok(())
}

fn recorded_measurement(t: usize) -> [f64; 2] {
    let t = t as f64;
    [5.2 + 0.4 * t + 0.1 * (1.7 * t).sin(), 0.9 - 0.012 * t + 0.02 * (2.3 * t).cos()]
}

fn set_up(state: &mut GaussianState) {
    let copies = state.batch;
    (state.x, state.P) = (X0.repeat(copies), diagonal(&P0).repeat(copies));
    (state.Q, state.R) = (diagonal(&Q), diagonal(&R));
}

/// Compares with a recorded run, two identical states in the batch.
fn check_record(name: &str, tolerance: f64, state: impl Fn(usize) -> GaussianState) {
    let record: serde_json::Value = serde_json::from_str(include_str!("../../tests/golden/filters.json")).unwrap();
    let rows = record[name].as_array().unwrap();
    assert_eq!(rows.len(), 6);
    for (row, t) in rows.iter().zip((4..).step_by(5)) {
        let state = state(t);
        let near = |got: f64, want: &serde_json::Value, what: &str| {
            let want = want.as_f64().unwrap();
            assert!((got - want).abs() <= tolerance * want.abs().max(1e-3), "{name} step {t} {what}: {got} {want}");
        };
        for b in 0..2 {
            (0..4).for_each(|k| near(state.x[b * 4 + k], &row["x"][k], "x"));
            (0..16).for_each(|k| near(state.P[b * 16 + k], &row["P"][k], "P"));
            near(state.log_likelihood[b], &row["log_likelihood"], "log likelihood");
        }
    }
}

#[test]
fn unscented_filter_equals_filterpy() {
    for (name, points) in
        [("unscented", SigmaPoints::default()), ("unscented_narrow", SigmaPoints::new(0.1, 2.0, -1.0).unwrap())]
    {
        check_record(name, 1e-8, |last| {
            let mut filter = UnscentedFilter::new(2, 4, 2, points).unwrap();
            set_up(&mut filter);
            for t in 0..=last {
                filter.predict(travel).unwrap();
                filter.update(&recorded_measurement(t).repeat(2), sight).unwrap();
            }
            assert_eq!(filter.repairs, 0);
            filter.state
        });
    }
}

#[test]
fn extended_filter_equals_filterpy_with_either_jacobian() {
    for differences in [false, true] {
        check_record("extended", if differences { 1e-6 } else { 1e-9 }, |last| {
            let mut filter = ExtendedFilter::new(2, 4, 2).unwrap();
            set_up(&mut filter);
            for t in 0..=last {
                let z = recorded_measurement(t).repeat(2);
                if differences {
                    filter.predict_by_differences(travel).unwrap();
                    filter.update_by_differences(&z, sight).unwrap();
                } else {
                    filter.predict(travel, travel_jacobian).unwrap();
                    filter.update(&z, sight, sight_jacobian).unwrap();
                }
            }
            filter.state
        });
    }
}

/// Constant velocity in the plane; the position is measured.
fn linear_filter(batch: usize) -> KalmanFilter {
    let mut filter = KalmanFilter::new(batch, 4, 2).unwrap();
    set_up(&mut filter);
    filter.F = diagonal(&[1.0; 4]);
    (filter.F[2], filter.F[7]) = (0.5, 0.5);
    filter.H = vec![1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0];
    filter
}

#[test]
fn linear_filter_equals_filterpy() {
    check_record("linear", 1e-9, |last| {
        let mut filter = linear_filter(2);
        for t in 0..=last {
            filter.predict().unwrap();
            filter.update(&recorded_measurement(t).repeat(2)).unwrap();
        }
        filter.state
    });
}

#[test]
fn distances_are_finite_where_their_squares_are_not() {
    for z in [3e200, 3e-200] {
        let mut filter = KalmanFilter::new(1, 1, 1).unwrap();
        (filter.F, filter.H) = (vec![1.0], vec![1.0]);
        filter.update(&[z]).unwrap();
        // P = R = 1, so that S = 2.
        assert!((filter.mahalanobis[0] / (z / 2f64.sqrt()) - 1.0).abs() < 1e-12, "{}", filter.mahalanobis[0]);
    }
}

#[test]
fn of_a_measurement_the_components_that_are_there_are_used() {
    let mut filter = UnscentedFilter::new(3, 4, 2, SigmaPoints::default()).unwrap();
    set_up(&mut filter);
    filter.predict(travel).unwrap();
    let before = filter.clone();
    filter.update(&[5.2, 0.9, 5.2, f64::NAN, f64::NAN, f64::NAN], sight).unwrap();
    assert_eq!((&filter.x[8..], &filter.P[32..]), (&before.x[8..], &before.P[32..]), "nothing was measured");
    assert_eq!((filter.y[5], filter.log_likelihood[2], filter.mahalanobis[2]), (0.0, 0.0, 0.0));
    // The range alone, as a filter of one measured number.
    let mut range = UnscentedFilter::new(1, 4, 1, SigmaPoints::default()).unwrap();
    (range.x, range.P) = (before.x[..4].to_vec(), before.P[..16].to_vec());
    (range.Q, range.R) = (diagonal(&Q), vec![R[0]]);
    range
        .update(&[5.2], |points, out| {
            points.chunks_exact(4).zip(out).for_each(|(p, z)| *z = p[0].hypot(p[1]));
            Ok(())
        })
        .unwrap();
    assert_eq!((&filter.x[4..8], &filter.P[16..32]), (&range.x[..], &range.P[..]));
    assert_eq!((filter.y[2], filter.y[3], filter.S[4]), (range.y[0], 0.0, range.S[0]));
    assert_eq!(filter.log_likelihood[1], range.log_likelihood[0]);
    assert_ne!(filter.x[..4], filter.x[4..8]);
}

#[test]
fn a_failing_callback_is_passed_on_and_changes_nothing() {
    let mut filter = UnscentedFilter::new(1, 4, 2, SigmaPoints::default()).unwrap();
    set_up(&mut filter);
    let before = filter.clone();
    let broken = |_: &[f64], _: &mut [f64]| Err(Error::Numerical("no road".into()));
    assert!(filter.predict(broken).unwrap_err().to_string().contains("no road"));
    assert!(filter.update(&[1.0, 2.0], broken).unwrap_err().to_string().contains("no road"));
    let wild = |_: &[f64], out: &mut [f64]| {
        out.fill(f64::NAN);
        Ok(())
    };
    assert!(filter.predict(wild).unwrap_err().to_string().contains("fx"));
    assert!(filter.update(&[1.0, 2.0], wild).unwrap_err().to_string().contains("hx"));
    assert_eq!(filter, before);
}

#[test]
fn points_drawn_anew_carry_the_process_noise() {
    let run = |redraw| {
        let mut filter = UnscentedFilter::new(1, 4, 2, SigmaPoints::default()).unwrap();
        set_up(&mut filter);
        filter.redraw = redraw;
        filter.predict(travel).unwrap();
        filter.update(&[5.5, 0.9], sight).unwrap();
        filter.S[0]
    };
    assert!((run(true) - run(false) - Q[0]).abs() < 0.1 * Q[0], "range sees Q along the line of sight");
}

#[test]
fn weights_and_points_have_the_moments_they_stand_for() {
    for points in [SigmaPoints::default(), SigmaPoints::new(1e-2, 2.0, 1.0).unwrap()] {
        let (x, p) = ([1.0, -2.0, 0.5], [2.0, 0.3, -0.1, 0.3, 1.0, 0.2, -0.1, 0.2, 0.5]);
        let drawn = points.sigma_points(&x, &p).unwrap();
        let (wm, wc) = (points.mean_weights(3), points.covariance_weights(3));
        assert!((wm.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        for a in 0..3 {
            let mean: f64 = drawn.chunks_exact(3).zip(&wm).map(|(d, w)| w * d[a]).sum();
            assert!((mean - x[a]).abs() < 1e-9);
            for b in 0..3 {
                let c: f64 = drawn.chunks_exact(3).zip(&wc).map(|(d, w)| w * (d[a] - x[a]) * (d[b] - x[b])).sum();
                assert!((c - p[a * 3 + b]).abs() < 1e-9);
            }
        }
    }
    assert!(SigmaPoints::new(0.0, 2.0, 0.0).unwrap_err().to_string().contains("alpha"));
    let far = SigmaPoints::new(1.0, 2.0, -4.0).unwrap();
    assert!(UnscentedFilter::new(1, 4, 2, far).unwrap_err().to_string().contains("kappa"));
    assert!(points_error(&[1.0, 2.0, 2.0, 1.0]).contains("positive definite"));
}

fn points_error(p: &[f64]) -> String {
    SigmaPoints::default().sigma_points(&[0.0, 0.0], p).unwrap_err().to_string()
}

#[test]
fn wrong_sizes_are_named_and_states_survive_serialisation() {
    assert!(KalmanFilter::new(0, 4, 2).unwrap_err().to_string().contains("batch"));
    let mut filter = linear_filter(2);
    assert!(filter.update(&[1.0]).unwrap_err().to_string().starts_with('z'));
    filter.R = vec![1.0];
    assert!(filter.predict().unwrap_err().to_string().starts_with('R'));
    let filter = linear_filter(2);
    let text = serde_json::to_string(&filter).unwrap();
    assert_eq!(serde_json::from_str::<KalmanFilter>(&text).unwrap(), filter);
}

#[test]
fn noise_may_differ_from_state_to_state() {
    let mut filter = linear_filter(2);
    filter.Q = [diagonal(&Q), diagonal(&Q.map(|q| 2.0 * q))].concat();
    filter.predict().unwrap();
    assert!((filter.P[16] - filter.P[0] - Q[0]).abs() < 1e-15);
}

#[test]
fn on_a_linear_system_all_filters_are_one() {
    let mut linear = linear_filter(3);
    let (f, h) = (linear.F.clone(), linear.H.clone());
    let product = |matrix: &[f64], points: &[f64], out: &mut [f64]| {
        let rows = matrix.len() / 4;
        for (p, out) in points.chunks_exact(4).zip(out.chunks_exact_mut(rows)) {
            for (row, out) in matrix.chunks_exact(4).zip(out) {
                *out = row.iter().zip(p).map(|(m, p)| m * p).sum();
            }
        }
        Ok(())
    };
    let mut unscented = UnscentedFilter::new(3, 4, 2, SigmaPoints::new(0.7, 2.0, 1.0).unwrap()).unwrap();
    let mut augmented = UnscentedFilter::new(3, 4, 2, SigmaPoints::default()).unwrap();
    let mut extended = ExtendedFilter::new(3, 4, 2).unwrap();
    for state in [&mut unscented.state, &mut augmented.state, &mut extended.state] {
        set_up(state);
    }
    let rng = CounterRng::new(5);
    for t in 0..40 {
        let z: Vec<f64> = (0..6).map(|k| rng.normal(t * 6 + k)).collect();
        linear.predict().unwrap();
        linear.update(&z).unwrap();
        unscented.predict(|p, out| product(&f, p, out)).unwrap();
        unscented.update(&z, |p, out| product(&h, p, out)).unwrap();
        augmented
            .predict_augmented(|p, w, out| {
                product(&f, p, out)?;
                out.iter_mut().zip(w).for_each(|(out, w)| *out += w);
                Ok(())
            })
            .unwrap();
        augmented.update(&z, |p, out| product(&h, p, out)).unwrap();
        extended.predict_by_differences(|p, out| product(&f, p, out)).unwrap();
        extended.update_by_differences(&z, |p, out| product(&h, p, out)).unwrap();
        for other in [&unscented.state, &augmented.state, &extended.state] {
            let pairs = linear.x.iter().chain(&linear.P).chain(&linear.log_likelihood);
            for (a, b) in pairs.zip(other.x.iter().chain(&other.P).chain(&other.log_likelihood)) {
                assert!((a - b).abs() < 1e-8 * a.abs().max(1.0), "{a} {b}");
            }
        }
    }
}

#[test]
fn errors_are_as_large_as_the_filters_say() {
    // 300 journeys at once: NEES averages the dimension of the state, NIS that of the measurement.
    let (batch, steps) = (300, 25);
    let rng = CounterRng::new(42);
    let draw = |stream: u64, b: usize, k: usize| rng.stream(stream).normal((b * 8 + k) as u64);
    let mut truth: Vec<f64> =
        (0..batch * 4).map(|i| X0[i % 4] + (0.2 * P0[i % 4]).sqrt() * draw(0, i / 4, i % 4)).collect();
    let mut unscented = UnscentedFilter::new(batch, 4, 2, SigmaPoints::default()).unwrap();
    let mut extended = ExtendedFilter::new(batch, 4, 2).unwrap();
    for state in [&mut unscented.state, &mut extended.state] {
        set_up(state);
        state.P = diagonal(&P0.map(|p| 0.2 * p)).repeat(batch);
    }
    let (mut nees, mut nis) = ([0.0; 2], [0.0; 2]);
    for t in 1..=steps {
        let mut next = vec![0.0; truth.len()];
        travel(&truth, &mut next).unwrap();
        truth = (0..next.len()).map(|i| next[i] + Q[i % 4].sqrt() * draw(2 * t, i / 4, i % 4)).collect();
        let mut z = vec![0.0; batch * 2];
        sight(&truth, &mut z).unwrap();
        for (i, z) in z.iter_mut().enumerate() {
            *z += R[i % 2].sqrt() * draw(2 * t + 1, i / 2, i % 2);
        }
        unscented.predict(travel).unwrap();
        unscented.update(&z, sight).unwrap();
        extended.predict(travel, travel_jacobian).unwrap();
        extended.update(&z, sight, sight_jacobian).unwrap();
        for (k, state) in [&unscented.state, &extended.state].into_iter().enumerate() {
            for b in 0..batch {
                let squared = |matrix: &[f64], error: &[f64]| {
                    let error = DVector::from_row_slice(error);
                    let matrix = DMatrix::from_row_slice(error.len(), error.len(), matrix);
                    error.dot(&matrix.cholesky().unwrap().solve(&error))
                };
                let error: Vec<f64> = (0..4).map(|i| state.x[b * 4 + i] - truth[b * 4 + i]).collect();
                nees[k] += squared(&state.P[b * 16..(b + 1) * 16], &error);
                nis[k] += squared(&state.S[b * 4..(b + 1) * 4], &state.y[b * 2..(b + 1) * 2]);
            }
        }
    }
    let count = (batch as u64 * steps) as f64;
    for k in 0..2 {
        assert!((3.6..4.4).contains(&(nees[k] / count)), "NEES {}", nees[k] / count);
        assert!((1.85..2.15).contains(&(nis[k] / count)), "NIS {}", nis[k] / count);
    }
}
