//! Horn and Schunck's baseline.

use jacoflow::error::Error;
use jacoflow::flow::baseline::{HornSchunckOptions, Smoothness};
use jacoflow::flow::{Estimator, EstimatorOptions, Method};
use jacoflow::parallel::Threads;
use jacoflow::synth::{RotatingRamp, Scene};
use jacoflow::types::{FlowField, Frame, Status};

fn estimate(options: HornSchunckOptions, threads: usize, frames: &[Frame<f64>]) -> FlowField<f64> {
    let common = EstimatorOptions { threads: Threads::new(Some(threads)).unwrap(), ..EstimatorOptions::default() };
    let estimator = Estimator::new(Method::HornSchunck(options), common).unwrap();
    estimator.estimate(&frames.iter().collect::<Vec<_>>(), 0).unwrap()
}

/// WO2010/098160, (50), (51) with the y-extent b where the print has a: `u = -w y + g w sinh(beta y / g) /
/// (beta cosh(beta b / g))`.
#[test]
fn the_turning_ramp_gives_the_biased_closed_form() {
    let (w, h) = (23, 83);
    let ramp = RotatingRamp::reference(w, h).centred_at(0.0, 0.0);
    let frames: Vec<Frame<f64>> = [-1.0, 0.0, 1.0].iter().map(|&t| ramp.frame(t)).collect();
    let (beta, turn) = (0.2, std::f64::consts::PI / 100.0);
    for g in [0.5, 2.0, 8.0] {
        let options = HornSchunckOptions {
            smoothness: Smoothness::Absolute(g),
            tolerance: 1e-10,
            ..HornSchunckOptions::default()
        };
        let field = estimate(options, 1, &frames);
        // Pixels are cells: the domain of 81 rows reaches from -40.5 to 40.5.
        let b = 40.5;
        for y in -40i32..=40 {
            let i = (y + 41) as usize * field.width + 11;
            let y = f64::from(y);
            let k = beta / g;
            let bias = g * turn * (k * y).sinh() / (beta * (k * b).cosh());
            let got = field.motion[i];
            // sin w instead of w in the central difference, and the grid's second-order error.
            assert!((got - (bias - turn * y)).abs() < 2e-3, "g {g}, y {y}: {got}, {}", bias - turn * y);
            assert_eq!(field.status[i], Status::MinNorm);
        }
        // Far from the truth at the edge: the global method is biased there.
        let edge = field.motion[81 * field.width + 11];
        assert!((edge + turn * 40.0).abs() > 0.5 * g * turn / beta * 0.8);
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits_and_nothing_moves_in_a_constant_image() {
    let frames: Vec<Frame<f64>> = (0..3)
        .map(|t| {
            Frame::from_fn(150, 90, |x, y| {
                50.0 * (0.2 * (x as f64 - 0.3 * f64::from(t))).sin() + 40.0 * (0.17 * y as f64 + 0.05 * x as f64).cos()
            })
        })
        .collect();
    let bits =
        |n| estimate(HornSchunckOptions::default(), n, &frames).motion.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(1), bits(2));
    let flat = vec![Frame::filled(12, 9, 0.3); 3];
    let field = estimate(HornSchunckOptions::default(), 1, &flat);
    assert_eq!((field.status[13], field.status[0]), (Status::Unobservable, Status::Border));
}

#[test]
fn intensity_gain_changes_nothing_and_failure_to_converge_is_an_error() {
    let frames = |gain: f64| -> Vec<Frame<f64>> {
        (0..3)
            .map(|t| {
                Frame::from_fn(40, 30, |x, y| {
                    gain * ((0.4 * (x as f64 - 0.3 * f64::from(t))).sin() + (0.37 * y as f64 + 0.15 * x as f64).cos())
                })
            })
            .collect()
    };
    let of = |gain| estimate(HornSchunckOptions::default(), 1, &frames(gain));
    let a = of(1.0);
    assert_eq!(a.status[15 * 40 + 20], Status::Ok);
    for gain in [1e-100, 1000.0, 1e100] {
        let b = of(gain);
        assert_eq!(a.status, b.status, "{gain}");
        for (p, q) in a.motion.iter().zip(&b.motion) {
            assert!(p.is_nan() && q.is_nan() || (p - q).abs() < 1e-5, "{gain}: {p} {q}");
        }
    }
    let hurried = HornSchunckOptions { iterations: 1, ..HornSchunckOptions::default() };
    let estimator = Estimator::new(Method::HornSchunck(hurried), EstimatorOptions::default()).unwrap();
    let f = frames(1.0);
    assert!(matches!(estimator.estimate(&[&f[0], &f[1], &f[2]], 0), Err(Error::Numerical(_))));
}
