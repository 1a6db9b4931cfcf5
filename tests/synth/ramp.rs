//! The reference scene of the patent: a brightness ramp turning about the origin.

use jacoflow::synth::{RotatingRamp, Scene};
use std::f64::consts::PI;

#[test]
fn flow_at_the_reference_pixel() {
    let scene = RotatingRamp::reference(64, 64).centred_at(60.0, 80.0);
    assert_eq!((scene.origin.0 + 32.0, scene.origin.1 + 32.0), (60.0, 80.0));
    let m = scene.motion(60.0, 80.0, 7.0).unwrap();
    assert!((m.u + 2.513274).abs() < 1e-6 && (m.v - 1.884956).abs() < 1e-6);
    assert_eq!((m.v_x, m.u_y), (PI / 100.0, -PI / 100.0));
}

#[test]
fn four_hundred_frames_are_two_turns() {
    let scene = RotatingRamp::reference(8, 8);
    let (first, last) = (scene.frame(0.0), scene.frame(400.0));
    assert!(first.data().iter().zip(last.data()).all(|(a, b)| (a - b).abs() < 1e-10));
    assert_eq!(first.get(3, 5), 128.0 + 0.2 * 3.0);
}

#[test]
fn brightness_is_carried_along() {
    let scene = RotatingRamp::reference(8, 8);
    let (dx, dy) = scene.displacement(60.0, 80.0, 3.0, 2.5).unwrap();
    let (before, after) = (scene.brightness(60.0, 80.0, 3.0), scene.brightness(60.0 + dx, 80.0 + dy, 5.5));
    assert!((before - after).abs() < 1e-12);
}
