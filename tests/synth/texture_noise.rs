//! Gaussian-filtered white noise that can be read between its lattice points.

use jacoflow::synth::texture::{Noise, Texture};

#[test]
fn has_the_spread_and_correlation_asked_for() {
    let (sigma, std) = (2.0, 40.0);
    let texture = Noise::new(sigma, std, 128.0, 11).unwrap();
    let at = |i: usize, shift: f64| texture.value((i % 120) as f64 * 8.3 + shift, (i / 120) as f64 * 8.3);
    let n = 120 * 120;
    let values: Vec<f64> = (0..n).map(|i| at(i, 0.0) - 128.0).collect();
    let variance = values.iter().map(|v| v * v).sum::<f64>() / n as f64;
    assert!((variance.sqrt() / std - 1.0).abs() < 0.03, "{}", variance.sqrt());
    for shift in [1.0, 2.5, 4.0, 6.0] {
        let products: f64 = (0..n).map(|i| values[i] * (at(i, shift) - 128.0)).sum();
        let want = (-shift * shift / (4.0 * sigma * sigma)).exp();
        assert!((products / n as f64 / (std * std) - want).abs() < 0.03, "{shift}");
    }
}

#[test]
fn unusable_parameters_are_named() {
    assert!(Noise::new(0.1, 1.0, 0.0, 0).unwrap_err().to_string().contains("sigma"));
    assert!(Noise::new(2.0, f64::NAN, 0.0, 0).unwrap_err().to_string().contains("std"));
    assert!(Noise::new(2.0, 1.0, 0.0, 0).unwrap().value(f64::NAN, 0.0).is_nan());
}
