//! A turning disc on a ground at rest.

use super::scene_conformance as conformance;
use jacoflow::synth::texture::Noise;
use jacoflow::synth::{RotatingDisc, Scene, radians_per_frame};
use jacoflow::types::AffineFlow;
use std::f64::consts::TAU;

fn scene() -> RotatingDisc<Noise> {
    RotatingDisc {
        size: (64, 64),
        origin: (0.0, 0.0),
        centre: (30.0, 33.0),
        radius: 22.0,
        rim: 2.0,
        angular_velocity: radians_per_frame(90.0, 60.0),
        disc: Noise::new(2.0, 30.0, 150.0, 1).unwrap(),
        ground: Noise::new(2.0, 20.0, 80.0, 2).unwrap(),
    }
}

#[test]
fn brightness_is_constant_along_the_true_motion() {
    conformance::check(&scene(), 1e-3);
}

#[test]
fn rim_has_no_truth_and_ground_rests() {
    let scene = scene();
    assert!(scene.motion(30.0 + 21.0, 33.0, 0.0).is_none() && scene.motion(30.0 + 23.5, 33.0, 0.0).is_none());
    assert_eq!(scene.motion(60.0, 60.0, 0.0), Some(AffineFlow::default()));
    let m = scene.motion(40.0, 33.0, 0.0).unwrap();
    assert!((m.v - 10.0 * TAU * 1.5 / 60.0).abs() < 1e-12 && m.u.abs() < 1e-12);
    assert_eq!(scene.brightness(60.0, 60.0, 0.0), scene.brightness(60.0, 60.0, 7.0));
}
