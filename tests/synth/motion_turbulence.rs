//! A random velocity field without divergence.

use super::motion_conformance as conformance;
use jacoflow::synth::motion::{Motion, Turbulence};

#[test]
fn velocity_jacobian_and_paths_agree() {
    conformance::check(&Turbulence::new(1.0, 128.0, 3), 1e-5);
}

#[test]
fn paths_are_as_good_as_much_finer_steps() {
    let field = Turbulence::new(1.0, 128.0, 3);
    for i in 0..200 {
        let start = (f64::from(i) * 37.1, f64::from(i) * 11.7);
        let (x, y) = field.path_map(0.0, 1.0)(start.0, start.1);
        let fine = (0..64).map(f64::from).fold(start, |(x, y), k| field.path_map(k / 64.0, (k + 1.0) / 64.0)(x, y));
        assert!((x - fine.0).hypot(y - fine.1) < 1e-6);
    }
}

#[test]
fn speed_is_as_asked_and_divergence_is_zero() {
    let field = Turbulence::new(1.3, 100.0, 9);
    let n = 10_000;
    let (mut energy, mut along_x) = (0.0, 0.0);
    for i in 0..n {
        let m = field.velocity((i % 100) as f64 * 137.3, (i / 100) as f64 * 91.7, 0.0);
        assert!((m.u_x + m.v_y).abs() < 1e-14);
        energy += m.u * m.u + m.v * m.v;
        along_x += m.u * m.u;
    }
    assert!(((energy / f64::from(n)).sqrt() - 1.3).abs() < 0.05);
    assert!((along_x / energy - 0.5).abs() < 0.15);
}
