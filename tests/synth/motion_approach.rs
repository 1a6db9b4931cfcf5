//! What a camera sees of a surface that it runs into.

use super::motion_conformance as conformance;
use jacoflow::synth::motion::{Approach, Motion};

#[test]
fn velocity_jacobian_and_paths_agree() {
    conformance::check(&Approach { time_to_contact: 40.0, focus_of_expansion: (10.0, 20.0) }, 1e-6);
    conformance::check(&Approach { time_to_contact: -60.0, focus_of_expansion: (31.5, 0.0) }, 1e-6);
}

#[test]
fn divergence_shows_the_time_to_contact() {
    let plane = Approach { time_to_contact: 40.0, focus_of_expansion: (10.0, 20.0) };
    let m = plane.velocity(3.0, 4.0, 15.0);
    assert!((2.0 / (m.u_x + m.v_y) - 25.0).abs() < 1e-12);
    assert!(plane.velocity(3.0, 4.0, 40.0).u.is_nan() && plane.path_map(0.0, 41.0)(3.0, 4.0).0.is_nan());
}
