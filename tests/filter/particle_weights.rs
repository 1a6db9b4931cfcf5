//! Weights of particles: normalisation in logarithms and the effective sample size.

use jacoflow::filter::particle::{effective_sample_size, normalise_log_weights};

#[test]
fn ten_thirds_of_four_particles_are_effective() {
    assert!((effective_sample_size(&[0.1, 0.2, 0.3, 0.4]) - 10.0 / 3.0).abs() < 1e-14);
    assert_eq!((effective_sample_size(&[2.0; 5]), effective_sample_size(&[0.0, 0.0])), (5.0, 0.0));
}

#[test]
fn nan_is_a_weight_of_zero_and_huge_logarithms_do_not_overflow() {
    let mut logs = [f64::NAN, -5000.0, f64::NEG_INFINITY, -5000.0 + 3.0f64.ln()];
    let sum = normalise_log_weights(&mut logs).unwrap();
    assert!((sum - (-5000.0 + 4.0f64.ln())).abs() < 1e-11);
    assert_eq!((logs[0], logs[2]), (f64::NEG_INFINITY, f64::NEG_INFINITY));
    assert!((logs[1] - 0.25f64.ln()).abs() < 1e-11 && (logs[3] - 0.75f64.ln()).abs() < 1e-11);
}

#[test]
fn weights_that_cannot_be_normalised_stay() {
    let (nan, none) = (f64::NAN, f64::NEG_INFINITY);
    for given in [[nan, nan], [none, none], [nan, none], [0.0, f64::INFINITY]] {
        let mut logs = given;
        assert_eq!(normalise_log_weights(&mut logs), None);
        assert_eq!(logs.map(f64::to_bits), given.map(f64::to_bits));
    }
    assert_eq!(normalise_log_weights(&mut []), None);
}
