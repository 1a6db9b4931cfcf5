//! A steady affine velocity field.

use super::motion_conformance as conformance;
use jacoflow::synth::motion::{AffineField, Motion};

#[test]
fn velocity_jacobian_and_paths_agree() {
    conformance::check(&AffineField::new([0.3, -0.2, 0.01, 0.02, -0.02, 0.01], (31.5, 31.5)), 1e-7);
    conformance::check(&AffineField::new([0.5, 0.25, 0.0, 0.0, 0.0, 0.0], (0.0, 0.0)), 1e-7);
}

#[test]
fn a_rotation_comes_back_after_a_turn() {
    let field = AffineField::rotation(std::f64::consts::TAU / 50.0, (10.0, 20.0));
    let (x, y) = field.path_map(0.0, 50.0)(33.0, -4.0);
    assert!((x - 33.0).abs() < 1e-10 && (y + 4.0).abs() < 1e-10);
    assert!(field.velocity(11.0, 20.0, 0.0).v > 0.0);
}

#[test]
fn a_pure_stretch_along_x_moves_nothing_along_y() {
    let field = AffineField::new([0.0, 0.0, 0.05, 0.0, 0.0, 0.0], (0.0, 0.0));
    let (x, y) = field.path_map(0.0, 3.0)(2.0, 7.0);
    assert!((x - 2.0 * 0.15f64.exp()).abs() < 1e-12 && y == 7.0);
}
