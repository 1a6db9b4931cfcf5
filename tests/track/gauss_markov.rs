//! The Gauss-Markov filter of position, velocity and acceleration.

use jacoflow::track::gradient::{Dynamics, GaussMarkovFilter, Measurement, Velocity};

fn measured(position: [f64; 2], velocity: [f64; 2], r: [f64; 2]) -> Measurement {
    Measurement { position: Some((position, [r[0]; 2])), velocity: Some((velocity, [r[1]; 2])) }
}

#[test]
fn the_steady_gain_as_printed_is_that_of_the_riccati_equation() {
    let mut f = GaussMarkovFilter::new([0.0; 2], Dynamics::default(), Velocity::AsPrinted);
    let z = measured([0.0; 2], [0.0; 2], [1.0, 0.25]);
    for _ in 0..400 {
        f.predict();
        f.update(&z);
    }
    let p = f.p[0];
    for (k, want) in [0.3543, 0.1879, 0.629].into_iter().enumerate() {
        assert!((p[(k, k)] - want).abs() < 1e-3, "{k}: {}", p[(k, k)]);
    }
    // K = P H' R^-1 with the covariance after the update.
    let want = [[0.3543, 0.3795], [0.0949, 0.7517], [-0.0079, 0.4635]];
    for (i, row) in want.into_iter().enumerate() {
        for (j, want) in row.into_iter().enumerate() {
            let gain = p[(i, j)] / [1.0, 0.25][j];
            assert!((gain - want).abs() < 1e-3, "{i} {j}: {gain}");
        }
    }
}

#[test]
fn the_mean_velocity_of_a_circle_is_taken_for_what_it_is() {
    // On a circle the mean velocity lags by half a frame; as printed that is an error.
    let rmse = |velocity: Velocity, period: f64| {
        let dynamics = Dynamics { q: 0.05, ..Dynamics::default() };
        let w = std::f64::consts::TAU / period;
        let at = |k: i32| [24.0 * (w * f64::from(k)).cos(), 24.0 * (w * f64::from(k)).sin()];
        let mut f = GaussMarkovFilter::new(at(0), dynamics, velocity);
        let (mut sum, mut count) = (0.0, 0);
        for k in 1..400 {
            f.predict();
            let (now, before) = (at(k), at(k - 1));
            f.update(&measured(now, [now[0] - before[0], now[1] - before[1]], [0.05, 0.05]));
            if k > 60 {
                sum += (f.x[0][1] + 24.0 * w * (w * f64::from(k)).sin()).powi(2);
                count += 1;
            }
        }
        (sum / f64::from(count)).sqrt()
    };
    for period in [50.0, 25.0] {
        assert!(rmse(Velocity::Mean, period) < 0.95 * rmse(Velocity::AsPrinted, period));
    }
}

#[test]
fn innovations_are_those_of_the_joint_measurement_and_nothing_measured_changes_nothing() {
    let mut f = GaussMarkovFilter::new([3.0, 4.0], Dynamics::default(), Velocity::Mean);
    f.predict();
    let before = f.clone();
    assert_eq!(f.update(&Measurement::default()), 0.0);
    assert_eq!(f, before);
    let z = measured([4.0, 4.0], [0.5, 0.0], [1.0, 0.25]);
    let want: f64 = (0..2)
        .map(|axis| {
            let h = nalgebra::Matrix2x3::new(1.0, 0.0, 0.0, 0.0, 1.0, -0.5 / 0.8);
            let s = h * f.p[axis] * h.transpose() + nalgebra::Matrix2::new(1.0, 0.0, 0.0, 0.25);
            let y = nalgebra::Vector2::new([4.0, 4.0][axis], [0.5, 0.0][axis]) - h * f.x[axis];
            (y.transpose() * s.try_inverse().unwrap() * y)[0]
        })
        .sum();
    assert!((f.innovation(&z) - want).abs() < 1e-12);
    assert_eq!(f, before);
    f.shift([2.0, -1.0]);
    assert_eq!(f.position(), [5.0, 3.0]);
}
