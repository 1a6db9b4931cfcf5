//! A smooth random velocity field of one scale.

use super::motion_conformance as conformance;
use jacoflow::synth::motion::{Motion, Waves};
use std::f64::consts::TAU;

#[test]
fn velocity_jacobian_and_paths_agree() {
    conformance::check(&Waves::new(2.0, 64.0, 3), 1e-5);
    conformance::check(&Waves::new(8.0, 256.0, 5), 1e-5);
}

#[test]
fn paths_are_as_good_as_much_finer_steps() {
    for (speed, wavelength) in [(8.0, 64.0), (4.0, 64.0), (8.0, 256.0), (0.5, 32.0)] {
        let field = Waves::new(speed, wavelength, 7);
        for i in 0..100 {
            let start = (f64::from(i) * 37.1, f64::from(i) * 11.7);
            for sign in [1.0, -1.0] {
                let (x, y) = field.path_map(0.0, sign)(start.0, start.1);
                let fine = (0..16).fold(start, |(x, y), _| field.path_map(0.0, sign / 16.0)(x, y));
                let off = (x - fine.0).hypot(y - fine.1);
                assert!(off < 1e-6, "{speed} px/frame, {wavelength} px: {off} px");
            }
        }
    }
}

#[test]
fn has_the_speed_and_scale_asked_for_with_divergence_and_curl() {
    for seed in 0..6 {
        let field = Waves::new(1.3, 100.0, seed);
        let n = 10_000;
        let (mut energy, mut slopes, mut divergence, mut curl) = (0.0, 0.0, 0.0, 0.0);
        for i in 0..n {
            let m = field.velocity((i % 100) as f64 * 137.3, (i / 100) as f64 * 91.7, 0.0);
            energy += m.u * m.u + m.v * m.v;
            slopes += m.u_x * m.u_x + m.u_y * m.u_y + m.v_x * m.v_x + m.v_y * m.v_y;
            divergence += (m.u_x + m.v_y).powi(2);
            curl += (m.v_x - m.u_y).powi(2);
        }
        assert!(((energy / f64::from(n)).sqrt() - 1.3).abs() < 0.05);
        let wave_number = (slopes / energy).sqrt();
        assert!((wave_number * 100.0 / TAU - 1.0).abs() < 0.2, "{wave_number}");
        for part in [divergence, curl] {
            assert!(part / (divergence + curl) > 0.25, "{divergence} {curl}");
        }
    }
}
