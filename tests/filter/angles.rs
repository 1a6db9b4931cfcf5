//! States and measurements that hold angles, and the smoother.

use jacoflow::error::Result;
use jacoflow::filter::{ExtendedFilter, KalmanFilter, Manifold, SigmaPoints, UnscentedFilter, Vectors};
use jacoflow::math::random::CounterRng;
use std::f64::consts::{PI, TAU};

/// Heading in the state's third component, bearing in the measurement's second.
struct Angles;

fn wrap(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}

fn subtract(a: &[f64], b: &[f64], (width, angle): (usize, usize), out: &mut [f64]) {
    for (k, ((out, a), b)) in out.iter_mut().zip(a).zip(b).enumerate() {
        *out = if k % width == angle { wrap(a - b) } else { a - b };
    }
}

fn mean(points: &[f64], weights: &[f64], (width, angle): (usize, usize), out: &mut [f64]) {
    for (rows, out) in points.chunks_exact(weights.len() * width).zip(out.chunks_exact_mut(width)) {
        let sum = |of: &dyn Fn(&[f64]) -> f64| -> f64 {
            rows.chunks_exact(width).zip(weights).map(|(row, w)| w * of(row)).sum()
        };
        for (k, out) in out.iter_mut().enumerate() {
            *out =
                if k == angle { sum(&|row| row[k].sin()).atan2(sum(&|row| row[k].cos())) } else { sum(&|row| row[k]) };
        }
    }
}

impl Manifold for Angles {
    fn residual_x(&mut self, a: &[f64], b: &[f64], out: &mut [f64]) -> Result<()> {
        subtract(a, b, (3, 2), out);
        Ok(())
    }
    fn residual_z(&mut self, a: &[f64], b: &[f64], out: &mut [f64]) -> Result<()> {
        subtract(a, b, (2, 1), out);
        Ok(())
    }
    fn state_add(&mut self, x: &[f64], dx: &[f64], out: &mut [f64]) -> Result<()> {
        for (k, ((out, x), dx)) in out.iter_mut().zip(x).zip(dx).enumerate() {
            *out = if k % 3 == 2 { wrap(x + dx) } else { x + dx };
        }
        Ok(())
    }
    fn x_mean(&mut self, points: &[f64], weights: &[f64], n: usize, out: &mut [f64]) -> Result<()> {
        mean(points, weights, (n, 2), out);
        Ok(())
    }
    fn z_mean(&mut self, points: &[f64], weights: &[f64], m: usize, out: &mut [f64]) -> Result<()> {
        mean(points, weights, (m, 1), out);
        Ok(())
    }
}

/// Along the heading, turned by `turn`, by one metre; rows of (x, y, heading).
#[expect(clippy::unnecessary_wraps, reason = "as the filter calls it")]
fn drive(points: &[f64], out: &mut [f64]) -> Result<()> {
    for (p, q) in points.chunks_exact(3).zip(out.chunks_exact_mut(3)) {
        q.copy_from_slice(&[p[0] + p[2].cos(), p[1] + p[2].sin(), wrap(p[2] + 0.3)]);
    }
    Ok(())
}

/// Range and bearing of a landmark at (-20, 0).
#[expect(clippy::unnecessary_wraps, reason = "as the filter calls it")]
fn sight(points: &[f64], out: &mut [f64]) -> Result<()> {
    for (p, z) in points.chunks_exact(3).zip(out.chunks_exact_mut(2)) {
        let (dx, dy) = (-20.0 - p[0], -p[1]);
        z.copy_from_slice(&[dx.hypot(dy), wrap(dy.atan2(dx) - p[2])]);
    }
    Ok(())
}

const STEPS: usize = 60;

/// The true states and what is seen from them, with noise.
fn journey() -> (Vec<[f64; 3]>, Vec<[f64; 2]>) {
    let rng = CounterRng::new(8);
    let mut truth = vec![[0.0, 0.0, 3.0]];
    for t in 1..STEPS {
        let mut next = [0.0; 3];
        drive(&truth[t - 1], &mut next).unwrap();
        truth.push(next);
    }
    let seen = truth.iter().enumerate().map(|(t, x)| {
        let mut z = [0.0; 2];
        sight(x, &mut z).unwrap();
        [z[0] + 0.1 * rng.normal(2 * t as u64), wrap(z[1] + 0.05 * rng.normal(2 * t as u64 + 1))]
    });
    let seen = seen.collect();
    (truth, seen)
}

fn set_up(state: &mut jacoflow::filter::GaussianState) {
    state.x = vec![0.2, -0.2, 2.9];
    state.P = vec![0.1, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.05];
    state.Q = vec![1e-4, 0.0, 0.0, 0.0, 1e-4, 0.0, 0.0, 0.0, 1e-5];
    state.R = vec![0.01, 0.0, 0.0, 0.0025];
}

fn error(x: &[f64], truth: &[f64; 3]) -> f64 {
    (x[0] - truth[0]).hypot(x[1] - truth[1]).max(wrap(x[2] - truth[2]).abs())
}

/// A step of both filters with a measurement.
type Step<'a> = dyn FnMut(&mut UnscentedFilter, &mut ExtendedFilter, &[f64]) -> Result<()> + 'a;

#[test]
fn bearings_across_the_cut_do_not_disturb() {
    let (truth, seen) = journey();
    assert!(truth.windows(2).any(|pair| (pair[0][2] - pair[1][2]).abs() > PI), "headings cross the cut");
    assert!(seen.windows(2).any(|pair| (pair[0][1] - pair[1][1]).abs() > PI), "bearings cross the cut");
    let run = |manifold: &mut Step<'_>| {
        let mut unscented = UnscentedFilter::new(1, 3, 2, SigmaPoints::default()).unwrap();
        let mut extended = ExtendedFilter::new(1, 3, 2).unwrap();
        set_up(&mut unscented.state);
        set_up(&mut extended.state);
        let (mut worst, mut worst_extended) = (0.0f64, 0.0f64);
        for (t, z) in seen.iter().enumerate() {
            manifold(&mut unscented, &mut extended, if t == 0 { &[] } else { z }).unwrap();
            worst = worst.max(error(&unscented.x, &truth[t]));
            worst_extended = worst_extended.max(error(&extended.x, &truth[t]));
        }
        (worst, worst_extended)
    };
    let with = run(&mut |unscented, extended, z| {
        if !z.is_empty() {
            unscented.predict_on(&mut Angles, drive)?;
            extended.predict_by_differences_on(&mut Angles, drive)?;
            unscented.update_on(&mut Angles, z, sight)?;
            extended.update_by_differences_on(&mut Angles, z, sight)?;
        }
        Ok(())
    });
    let without = run(&mut |unscented, extended, z| {
        if !z.is_empty() {
            unscented.predict(drive)?;
            extended.predict_by_differences(drive)?;
            unscented.update(z, sight)?;
            extended.update_by_differences(z, sight)?;
        }
        Ok(())
    });
    assert!(with.0 < 0.5 && with.1 < 0.5, "{with:?}");
    assert!(without.0 > 2.0, "plain differences are far off: {without:?}");
}

#[test]
fn a_residual_across_the_cut_is_the_short_way() {
    let mut extended = ExtendedFilter::new(1, 3, 2).unwrap();
    set_up(&mut extended.state);
    extended.x = vec![0.0, 0.0, 0.05];
    let (start, mut predicted) = (extended.clone(), [0.0; 2]);
    sight(&extended.x, &mut predicted).unwrap();
    let z = [20.0, wrap(predicted[1] + 0.1)];
    assert!(predicted[1] > 3.0 && z[1] < -3.0);
    extended.update_by_differences_on(&mut Angles, &z, sight).unwrap();
    assert!((extended.y[1] - 0.1).abs() < 1e-12 && (extended.x[2] - 0.05).abs() < 0.15);
    let mut plain = start;
    plain.update_by_differences(&z, sight).unwrap();
    assert!(plain.y[1] < -6.0 && plain.x[2] > 1.0, "{:?}", plain.x);
}

#[test]
fn the_smoother_equals_one_solution_of_all_equations() {
    // A random walk measured directly: the smoothed mean minimises sum (x_t - x_{t-1})^2 / q + (z_t -
    // x_t)^2 / r.
    let (q, r, p0, steps) = (0.5, 2.0, 4.0, 12);
    let rng = CounterRng::new(3);
    let z: Vec<f64> = (0..steps).map(|t| rng.normal(t)).collect();
    let steps = steps as usize;
    let mut filter = KalmanFilter::new(1, 1, 1).unwrap();
    (filter.H, filter.Q, filter.R, filter.P) = (vec![1.0], vec![q], vec![r], vec![p0]);
    let (mut xs, mut ps) = (Vec::new(), Vec::new());
    for z in &z {
        filter.predict().unwrap();
        filter.update(&[*z]).unwrap();
        xs.push(filter.x[0]);
        ps.push(filter.P[0]);
    }
    let smoothed = filter.rts_smoother(&mut Vectors, (&xs, &ps), None, None).unwrap();
    let mut information = nalgebra::DMatrix::<f64>::zeros(steps, steps);
    let mut right = nalgebra::DVector::<f64>::zeros(steps);
    information[(0, 0)] += 1.0 / (p0 + q);
    for t in 0..steps {
        information[(t, t)] += 1.0 / r;
        right[t] = z[t] / r;
        if t > 0 {
            for (a, b, sign) in [(t, t, 1.0), (t - 1, t - 1, 1.0), (t, t - 1, -1.0), (t - 1, t, -1.0)] {
                information[(a, b)] += sign / q;
            }
        }
    }
    let covariance = information.try_inverse().unwrap();
    let x = &covariance * right;
    for t in 0..steps {
        assert!((smoothed.x[t] - x[t]).abs() < 1e-13, "{t}");
        assert!((smoothed.P[t] - covariance[(t, t)]).abs() < 1e-13, "{t}");
    }
    assert_eq!((smoothed.K[steps - 1], smoothed.Pp[steps - 1]), (0.0, ps[steps - 1]));
    assert!(filter.rts_smoother(&mut Vectors, (&xs, &ps[1..]), None, None).unwrap_err().to_string().starts_with("Ps"));
}

#[test]
fn on_a_linear_system_all_smoothers_are_one() {
    let steps = 15;
    let rng = CounterRng::new(4);
    let mut filter = KalmanFilter::new(2, 2, 1).unwrap();
    (filter.F, filter.H, filter.Q) = (vec![1.0, 0.5, 0.0, 1.0], vec![1.0, 0.0], vec![0.01, 0.0, 0.0, 0.02]);
    let (mut xs, mut ps) = (Vec::new(), Vec::new());
    for t in 0..steps {
        filter.predict().unwrap();
        filter.update(&[rng.normal(2 * t), if t == 4 { f64::NAN } else { rng.normal(2 * t + 1) }]).unwrap();
        xs.extend_from_slice(&filter.x);
        ps.extend_from_slice(&filter.P);
    }
    let given = (&xs[..], &ps[..]);
    let step = |_: usize, p: &[f64], out: &mut [f64]| {
        p.chunks_exact(2).zip(out.chunks_exact_mut(2)).for_each(|(p, q)| q.copy_from_slice(&[p[0] + 0.5 * p[1], p[1]]));
        Ok(())
    };
    let linear = filter.rts_smoother(&mut Vectors, given, None, None).unwrap();
    let mut unscented = UnscentedFilter::new(2, 2, 1, SigmaPoints::default()).unwrap();
    let mut extended = ExtendedFilter::new(2, 2, 1).unwrap();
    (unscented.Q, extended.Q) = (filter.Q.clone(), filter.Q.clone());
    let noisy = |k: usize, p: &[f64], w: &[f64], out: &mut [f64]| {
        step(k, p, out)?;
        out.iter_mut().zip(w).for_each(|(out, w)| *out += w);
        Ok(())
    };
    type Jacobian = fn(usize, &[f64], &mut [f64]) -> Result<()>;
    for other in [
        unscented.rts_smoother(&mut Vectors, given, None, step).unwrap(),
        unscented.rts_smoother_augmented(&mut Vectors, given, None, noisy).unwrap(),
        extended.rts_smoother(&mut Vectors, given, None, step, None::<Jacobian>).unwrap(),
    ] {
        let pairs = linear.x.iter().chain(&linear.P).chain(&linear.K).chain(&linear.Pp);
        for (a, b) in pairs.zip(other.x.iter().chain(&other.P).chain(&other.K).chain(&other.Pp)) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }
    // Information of the future narrows every covariance but the last.
    for (filtered, smoothed) in ps.chunks(4).zip(linear.P.chunks(4)).take(2 * (steps as usize - 1)) {
        assert!(smoothed[0] < filtered[0] && smoothed[3] < filtered[3]);
    }
}
