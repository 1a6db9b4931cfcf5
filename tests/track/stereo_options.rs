//! The stereo cameras.

use jacoflow::track::stereo::StereoCamera;

#[test]
fn depth_is_that_of_two_cameras() {
    let camera = StereoCamera { focal: 800.0, baseline: 0.075, d_infinity: -44.0 };
    assert_eq!(camera.depth(-4.0), 1.5);
    assert_eq!(camera.place([400.0, 200.0, -4.0], [320.0, 240.0]), [0.15, -0.075, 1.5]);
    assert!(camera.depth(-44.0).is_nan());
}
