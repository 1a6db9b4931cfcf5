//! Tests of the filters against each other, against statistics, and against numbers recorded from filterpy
//! (`tests/golden/filters.py`).

// Callbacks return a result whether they can fail or not.

use super::*;
use crate::error::{Error, Result};
use crate::math::dense;
use crate::math::random::CounterRng;

mod soundness;

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

fn set_up(state: &mut GaussianState) {
    let copies = state.batch;
    (state.x, state.P) = (X0.repeat(copies), diagonal(&P0).repeat(copies));
    (state.Q, state.R) = (diagonal(&Q), diagonal(&R));
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
fn on_a_linear_system_all_filters_are_one() {
    let mut linear = linear_filter(3);
    let (f, h) = (linear.F.clone(), linear.H.clone());
    let product = |matrix: &[f64], points: &[f64], out: &mut [f64]| {
        let rows = matrix.len() / 4;
        for (p, out) in points.chunks_exact(4).zip(out.chunks_exact_mut(rows)) {
            dense::multiply(matrix, p, 4, out);
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
                    let n = error.len();
                    let (mut l, mut white) = (vec![0.0; n * n], error.to_vec());
                    assert!(dense::cholesky(matrix, n, &mut l));
                    dense::forward(&l, n, &mut white);
                    white.iter().map(|w| w * w).sum::<f64>()
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
