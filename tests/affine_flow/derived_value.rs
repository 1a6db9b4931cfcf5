//! Values of derived quantities, with their standard deviations by propagation.

use jacoflow::flow::derived::{Quantity, value_and_std};
use std::f64::consts::{FRAC_PI_4, PI};

fn value(q: Quantity, m: [f64; 6]) -> f64 {
    value_and_std(q, m, None, (10.0, 20.0), None).0
}

#[test]
fn textbook_motions_have_their_values() {
    // Rotation by 0.1 rad/frame about (13, 16): (u, v) = w (-(y - cy), x - cx).
    let w = 0.1;
    let rotation = [-w * 4.0, w * -3.0, 0.0, w, -w, 0.0];
    for (q, want) in [
        (Quantity::Divergence, 0.0),
        (Quantity::Curl, 0.2),
        (Quantity::AngularVelocity, 0.1),
        (Quantity::ShearMagnitude, 0.0),
        (Quantity::RotationCentreX, 13.0),
        (Quantity::RotationCentreY, 16.0),
        (Quantity::CentreDistance, 5.0),
        (Quantity::Speed, 0.5),
    ] {
        assert!((value(q, rotation) - want).abs() < 1e-12, "{q:?} {}", value(q, rotation));
    }
    let approach = [1.0, -2.0, 0.05, 0.0, 0.0, 0.05];
    assert!((value(Quantity::TimeToContact, approach) - 20.0).abs() < 1e-12);
    let diagonal = [0.0, 0.0, 0.0, 0.1, 0.1, 0.0];
    assert!((value(Quantity::ShearAxis, diagonal) - FRAC_PI_4).abs() < 1e-12);
    assert!((value(Quantity::ShearMagnitude, diagonal) - 0.2).abs() < 1e-12);
    assert!((value(Quantity::StrainXy, diagonal) - 0.1).abs() < 1e-12);
    let stretch = [0.0, 0.0, 0.1, 0.0, 0.0, 0.0];
    assert_eq!((value(Quantity::ShearAxis, stretch), value(Quantity::StrainXx, stretch)), (0.0, 0.1));
}

#[test]
fn the_frame_period_turns_frames_into_seconds() {
    let m = [3.0, 4.0, 0.0, PI / 50.0, -PI / 50.0, 0.02];
    let with = |q| value_and_std(q, m, None, (0.0, 0.0), Some(0.02)).0;
    assert!((with(Quantity::Rpm) - 30.0).abs() < 1e-9);
    assert!((with(Quantity::AngularVelocity) - PI).abs() < 1e-9);
    assert!((with(Quantity::TimeToContact) - 2.0).abs() < 1e-9);
    assert!((with(Quantity::Speed) - 250.0).abs() < 1e-9);
    assert!(value(Quantity::Rpm, m).is_nan());
    assert_eq!(Quantity::TimeToContact.unit(true), "s");
}

#[test]
fn standard_deviations_agree_with_simulation() {
    let rng = jacoflow::math::random::CounterRng::new(4);
    let m = [1.0, -0.7, 0.05, 0.04, -0.06, 0.03];
    let sd = [0.02, 0.03, 0.0005, 0.0007, 0.0006, 0.0004];
    // Correlated: each parameter shares a common factor.
    let mut covariance = [[0.0; 6]; 6];
    for i in 0..6 {
        for j in 0..6 {
            covariance[i][j] = sd[i] * sd[j] * if i == j { 1.0 } else { 0.5 };
        }
    }
    for q in Quantity::ALL {
        let want = value_and_std(q, m, Some(covariance), (5.0, 6.0), Some(0.5)).1.unwrap();
        let n = 20_000u64;
        let values: Vec<f64> = (0..n)
            .map(|k| {
                let common = rng.normal(10 * k);
                let draw: [f64; 6] = std::array::from_fn(|i| {
                    m[i] + sd[i] * (0.5f64.sqrt() * common + 0.5f64.sqrt() * rng.normal(10 * k + 1 + i as u64))
                });
                value_and_std(q, draw, None, (5.0, 6.0), Some(0.5)).0
            })
            .collect();
        let mean = values.iter().sum::<f64>() / n as f64;
        let got = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n as f64).sqrt();
        assert!((got / want - 1.0).abs() < 0.04, "{q:?}: simulated {got}, propagated {want}");
    }
}
