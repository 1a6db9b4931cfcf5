//! Shared checks: each motion's velocity, Jacobian and paths must agree.

use jacoflow::synth::motion::Motion;

/// Points near which the checks are made.
const POINTS: [(f64, f64); 5] = [(3.0, -2.0), (20.5, 11.0), (31.0, 33.0), (-14.0, 40.2), (32.0, 31.5)];

pub fn check(motion: &dyn Motion, tolerance: f64) {
    for (x, y) in POINTS {
        for t in [0.0, 0.7, 3.0] {
            jacobian_is_the_derivative(motion, x, y, t, tolerance);
            paths_follow_the_velocity(motion, x, y, t, tolerance);
            paths_go_back(motion, x, y, t, tolerance);
        }
    }
}

fn jacobian_is_the_derivative(motion: &dyn Motion, x: f64, y: f64, t: f64, tolerance: f64) {
    let h = 1e-4;
    let m = motion.velocity(x, y, t);
    let slope = |a: jacoflow::types::AffineFlow<f64>, b: jacoflow::types::AffineFlow<f64>| {
        ((a.u - b.u) / (2.0 * h), (a.v - b.v) / (2.0 * h))
    };
    let along_x = slope(motion.velocity(x + h, y, t), motion.velocity(x - h, y, t));
    let along_y = slope(motion.velocity(x, y + h, t), motion.velocity(x, y - h, t));
    for (got, want) in [(m.u_x, along_x.0), (m.v_x, along_x.1), (m.u_y, along_y.0), (m.v_y, along_y.1)] {
        assert!((got - want).abs() < tolerance, "Jacobian at ({x}, {y}), t = {t}: {got} against {want}");
    }
}

fn paths_follow_the_velocity(motion: &dyn Motion, x: f64, y: f64, t: f64, tolerance: f64) {
    let h = 1e-3;
    let m = motion.velocity(x, y, t);
    let (ahead, behind) = (motion.path_map(t, t + h)(x, y), motion.path_map(t, t - h)(x, y));
    let (u, v) = ((ahead.0 - behind.0) / (2.0 * h), (ahead.1 - behind.1) / (2.0 * h));
    assert!((u - m.u).abs() < tolerance && (v - m.v).abs() < tolerance, "({x}, {y}), t = {t}: ({u}, {v}), {m:?}");
}

fn paths_go_back(motion: &dyn Motion, x: f64, y: f64, t: f64, tolerance: f64) {
    let (there_x, there_y) = motion.path_map(t, t + 4.0)(x, y);
    let (back_x, back_y) = motion.path_map(t + 4.0, t)(there_x, there_y);
    assert!((back_x - x).abs() < tolerance && (back_y - y).abs() < tolerance, "({x}, {y}), t = {t}");
}
