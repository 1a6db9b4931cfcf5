//! Sprayed blobs, as strain laboratories put on their specimens.

use jacoflow::synth::texture::{Speckle, Texture};

#[test]
fn covers_the_share_asked_for() {
    for coverage in [0.3, 0.5, 0.7] {
        let speckle = Speckle::new(3.0, coverage, 1.0, (20.0, 220.0), 5).unwrap();
        let n = 40_000;
        let dark = (0..n).filter(|i| speckle.value((i % 200) as f64 * 1.7, (i / 200) as f64 * 1.7) < 120.0).count();
        assert!((dark as f64 / f64::from(n) - coverage).abs() < 0.05, "{coverage}: {dark}");
    }
}

#[test]
fn stays_between_its_levels_and_has_no_jumps() {
    let speckle = Speckle::new(2.5, 0.5, 1.2, (20.0, 220.0), 8).unwrap();
    let mut last = speckle.value(-50.0, 3.3);
    for i in 1..20_000 {
        let value = speckle.value(-50.0 + f64::from(i) * 0.005, 3.3);
        assert!((20.0..=220.0).contains(&value) && (value - last).abs() < 3.0);
        last = value;
    }
}

#[test]
fn unusable_parameters_are_named() {
    let message = |r, c, e| Speckle::new(r, c, e, (0.0, 255.0), 0).unwrap_err().to_string();
    assert!(message(0.0, 0.5, 1.0).contains("radius"));
    assert!(message(3.0, 1.5, 1.0).contains("coverage"));
    assert!(message(3.0, 0.5, 4.0).contains("edge"));
}
