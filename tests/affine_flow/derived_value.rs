//! Values of derived quantities, with their standard deviations by propagation.

use jacoflow::flow::derived::{Motion, Quantity, unbiased_value_and_std, value_and_std};
use jacoflow::types::{Interval, Units};
use std::f64::consts::{FRAC_PI_4, PI};

fn motion(parameters: [f64; 6], units: &Units) -> Motion<'_> {
    Motion { parameters, covariance: None, at: (10.0, 20.0), interval: Interval::Instant, units }
}

fn value(q: Quantity, m: [f64; 6]) -> f64 {
    value_and_std(q, &motion(m, &Units::default())).0
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
    let units = Units::new((1.0, 1.0), None, Some(0.02));
    let with = |q| value_and_std(q, &motion(m.map(|value| value / 0.02), &units)).0;
    assert!((with(Quantity::Rpm) - 30.0).abs() < 1e-9);
    assert!((with(Quantity::AngularVelocity) - PI).abs() < 1e-9);
    assert!((with(Quantity::TimeToContact) - 2.0).abs() < 1e-9);
    assert!((with(Quantity::Speed) - 250.0).abs() < 1e-9);
    assert!(value(Quantity::Rpm, m).is_nan());
    assert_eq!(Quantity::TimeToContact.unit(&units), "s");
    let metric = Units::new((0.5, 0.5), Some("mm"), Some(0.02));
    assert_eq!((Quantity::Speed.unit(&metric), metric.of_parameter("u")), ("mm/s".into(), "mm/s".into()));
    assert_eq!((Quantity::Curl.unit(&metric), metric.of_parameter("v_x")), ("1/s".into(), "1/s".into()));
    assert_eq!(Quantity::RotationCentreX.unit(&Units::default()), "px");
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
        let units = Units::new((1.0, 1.0), None, Some(0.5));
        let claimed = Motion { covariance: Some(covariance), ..motion(m, &units) };
        let want = value_and_std(q, &claimed).1.unwrap();
        let n = 20_000u64;
        let values: Vec<f64> = (0..n)
            .map(|k| {
                let common = rng.normal(10 * k);
                let draw: [f64; 6] = std::array::from_fn(|i| {
                    m[i] + sd[i] * (0.5f64.sqrt() * common + 0.5f64.sqrt() * rng.normal(10 * k + 1 + i as u64))
                });
                value_and_std(q, &motion(draw, &units)).0
            })
            .collect();
        let mean = values.iter().sum::<f64>() / n as f64;
        let got = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n as f64).sqrt();
        assert!((got / want - 1.0).abs() < 0.04, "{q:?}: simulated {got}, propagated {want}");
    }
}

/// The Jacobian of the step of a camera that approaches from `z` to `z - 1` frames' way.
fn approach(z: f64, interval: Interval) -> f64 {
    let (after, before) = (z / (z - 1.0), z / (z + 1.0));
    match interval {
        Interval::Forward => after - 1.0,
        Interval::Central => 0.5 * (after - before),
        Interval::Instant => 1.0 / z,
    }
}

#[test]
fn the_time_to_contact_counts_from_the_frame_of_the_field() {
    for z in [59.0, 9.0, 4.0, 2.5] {
        for interval in Interval::ALL {
            let (growth, units) = (approach(z, interval), Units::default());
            let motion = Motion { interval, ..motion([0.0, 0.0, growth, 0.0, 0.0, growth], &units) };
            let found = value_and_std(Quantity::TimeToContact, &motion).0;
            assert!((found - z).abs() < 1e-9 * z, "{interval:?} {z}: {found}");
        }
    }
}

#[test]
fn rates_are_those_of_the_turn_and_not_of_its_chord() {
    let (sin, cos) = 15f64.to_radians().sin_cos();
    let units = Units::new((1.0, 1.0), None, Some(0.1));
    for (interval, step) in
        [(Interval::Forward, [cos - 1.0, sin, -sin, cos - 1.0]), (Interval::Central, [0.0, sin, -sin, 0.0])]
    {
        let [ux, vx, uy, vy] = step.map(|value| value / 0.1);
        let motion = Motion { interval, ..motion([0.0, 0.0, ux, vx, uy, vy], &units) };
        let value = |q| value_and_std(q, &motion).0;
        assert!((value(Quantity::Rpm) - 25.0).abs() < 1e-9, "{interval:?} {}", value(Quantity::Rpm));
        assert!(value(Quantity::Divergence).abs() < 1e-12 && value(Quantity::ShearMagnitude) < 1e-12);
    }
}

#[test]
fn noise_adds_nothing_to_a_length() {
    let (rng, units) = (jacoflow::math::random::CounterRng::new(9), Units::default());
    let mut covariance = [[0.0; 6]; 6];
    (covariance[0][0], covariance[1][1]) = (0.04, 0.04);
    let n = 4000u64;
    let mean_square = |of: fn(Quantity, &Motion<'_>) -> (f64, Option<f64>)| -> f64 {
        let square = |k: u64| {
            let drawn = [0.5 + 0.2 * rng.normal(2 * k), 0.2 * rng.normal(2 * k + 1), 0.0, 0.0, 0.0, 0.0];
            of(Quantity::Speed, &Motion { covariance: Some(covariance), ..motion(drawn, &units) }).0.powi(2)
        };
        (0..n).map(square).sum::<f64>() / n as f64
    };
    // 0.25 of the motion; noise adds 0.08.
    assert!((mean_square(value_and_std) - 0.33).abs() < 0.01);
    assert!((mean_square(unbiased_value_and_std) - 0.25).abs() < 0.015);
}
