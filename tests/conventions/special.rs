//! The logarithm of the gamma function and its derivative.

use jacoflow::math::special::{digamma, ln_gamma};

#[test]
fn digamma_has_its_known_values() {
    let euler = 0.577_215_664_901_532_9;
    let known = [
        (1.0, -euler),
        (0.5, -euler - 2.0 * std::f64::consts::LN_2),
        (2.0, 1.0 - euler),
        (10.0, 2.251_752_589_066_721),
        (1e6, 13.815_510_057_964_191),
        (0.1, -10.423_754_940_411_076),
    ];
    for (x, psi) in known {
        assert!((digamma(x) - psi).abs() <= 2e-15 * f64::max(1.0, psi.abs()), "{x}: {}", digamma(x));
    }
    assert!(digamma(0.0).is_nan() && digamma(f64::NAN).is_nan());
}

#[test]
fn digamma_is_the_slope_of_ln_gamma() {
    for i in 1..60 {
        let x = 0.07 * f64::from(i * i);
        let h = 1e-4 * x;
        let slope = (ln_gamma(x + h) - ln_gamma(x - h)) / (2.0 * h);
        assert!((slope - digamma(x)).abs() < 1e-6 * f64::max(1.0, digamma(x).abs()), "{x}");
    }
}
