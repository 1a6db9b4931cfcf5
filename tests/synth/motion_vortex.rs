//! A viscous vortex.

use super::motion_conformance as conformance;
use jacoflow::synth::motion::{LambOseen, Motion};
use std::f64::consts::TAU;

#[test]
fn velocity_jacobian_and_paths_agree() {
    let still = LambOseen { circulation: 150.0, core: 12.0, centre: (32.0, 31.5), drift: (0.0, 0.0) };
    conformance::check(&still, 1e-6);
    conformance::check(&LambOseen { drift: (0.7, -0.3), circulation: -90.0, ..still }, 1e-6);
}

#[test]
fn curl_is_the_vorticity_and_the_flow_has_no_divergence() {
    let vortex = LambOseen { circulation: 150.0, core: 12.0, centre: (32.0, 31.5), drift: (0.0, 0.0) };
    for (x, y) in [(32.0, 31.5), (32.1, 31.5), (34.5, 33.0), (50.0, 10.0), (90.0, 70.0)] {
        let m = vortex.velocity(x, y, 0.0);
        assert!((m.v_x - m.u_y - vortex.vorticity(x, y, 0.0)).abs() < 1e-12, "({x}, {y})");
        assert!((m.u_x + m.v_y).abs() < 1e-15);
    }
}

#[test]
fn far_away_the_circulation_is_all_there() {
    let vortex = LambOseen { circulation: 150.0, core: 5.0, centre: (0.0, 0.0), drift: (0.0, 0.0) };
    let m = vortex.velocity(40.0, 0.0, 0.0);
    assert!((m.v * TAU * 40.0 - 150.0).abs() < 1e-9);
}
