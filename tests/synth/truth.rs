//! The truth of whole frames, as flow fields.

use jacoflow::synth::{SceneOptions, build, check_time, mean_truth, truth};
use jacoflow::types::Status;

fn options(values: &[(&str, f64)]) -> SceneOptions {
    let values = values.iter().map(|(name, value)| ((*name).to_string(), *value)).collect();
    SceneOptions { width: 24, height: 20, origin: (3.0, -2.0), random_state: 4, values, ..SceneOptions::default() }
}

#[test]
fn a_rotation_moves_by_its_chord() {
    let angle = 0.2f64;
    let scene = build(
        "affine",
        &options(&[("u", 0.0), ("v", 0.0), ("u_x", 0.0), ("v_x", angle), ("u_y", -angle), ("v_y", 0.0)]),
    );
    let field = mean_truth(scene.unwrap().as_ref(), 0.0, (0.0, 1.0)).unwrap();
    // R(angle) - 1, the same everywhere.
    let (c, s) = (angle.cos() - 1.0, angle.sin());
    for index in [0, 77, field.len() - 1] {
        let m = field.affine(index);
        for (got, want) in [(m.u_x, c), (m.v_x, s), (m.u_y, -s), (m.v_y, c)] {
            assert!((got - want).abs() < 1e-8, "{m:?}");
        }
    }
    // From the middle of both frames the chord is along the velocity: no divergence.
    let scene = build(
        "affine",
        &options(&[("u", 0.0), ("v", 0.0), ("u_x", 0.0), ("v_x", angle), ("u_y", -angle), ("v_y", 0.0)]),
    );
    let m = mean_truth(scene.unwrap().as_ref(), 0.5, (-0.5, 0.5)).unwrap().affine(77);
    assert!((m.u_x + m.v_y).abs() < 1e-8 && (m.v_x - 2.0 * (angle / 2.0).sin()).abs() < 1e-8, "{m:?}");
}

#[test]
fn flow_is_the_scenes_displacement() {
    let scene = build("waves", &options(&[("speed", 3.0), ("wavelength", 64.0)])).unwrap();
    let (forward, both) = (mean_truth(scene.as_ref(), 1.0, (0.0, 1.0)), mean_truth(scene.as_ref(), 1.0, (-1.0, 1.0)));
    let (forward, both) = (forward.unwrap(), both.unwrap());
    for index in [0usize, 100, 479] {
        let (x, y) = (3.0 + (index % 24) as f64, -2.0 + (index / 24) as f64);
        let (ahead, behind) =
            (scene.displacement(x, y, 1.0, 1.0).unwrap(), scene.displacement(x, y, 1.0, -1.0).unwrap());
        assert_eq!((forward.affine(index).u, forward.affine(index).v), ahead);
        assert!((both.affine(index).u - 0.5 * (ahead.0 - behind.0)).abs() < 1e-12);
    }
}

#[test]
fn short_times_show_the_velocity() {
    let scene = build("vortex", &options(&[])).unwrap();
    let (short, exact) = (mean_truth(scene.as_ref(), 2.0, (-0.01, 0.01)).unwrap(), truth(scene.as_ref(), 2.0).unwrap());
    for index in 0..exact.len() {
        for (got, want) in short.affine(index).to_array().into_iter().zip(exact.affine(index).to_array()) {
            assert!((got - want).abs() < 1e-4, "{got} {want}");
        }
    }
}

#[test]
fn what_has_no_truth_is_masked_and_bad_times_are_named() {
    let scene = build("disc", &options(&[("disc_radius", 6.0)])).unwrap();
    let field = mean_truth(scene.as_ref(), 0.0, (0.0, 1.0)).unwrap();
    let masked = field.status.iter().filter(|&&status| status == Status::Masked).count();
    assert!(masked > 20 && masked < 400, "{masked}");
    for between in [(1.0, 1.0), (0.0, f64::NAN), (f64::INFINITY, 1.0)] {
        assert!(mean_truth(scene.as_ref(), 0.0, between).unwrap_err().to_string().contains("between"));
    }
}

#[test]
fn integrated_paths_end_at_their_longest_duration() {
    let size = options(&[]);
    let scene = build("turbulence", &size).unwrap();
    // 1e5 steps, 4 a frame.
    assert_eq!((scene.max_duration(), build("ramp", &size).unwrap().max_duration()), (25_000.0, f64::INFINITY));
    let refused = mean_truth(scene.as_ref(), 0.0, (0.0, 1e9)).unwrap_err().to_string();
    assert_eq!(refused, "between: expected two different times in frames, within 25000 of 0, got (0, 1e9)");
    let (x, y) = scene.displacement(1.0, 2.0, 0.0, 1e9).unwrap();
    assert!(x.is_nan() && y.is_nan());
    assert_eq!(check_time(scene.as_ref(), "t", -25_000.0).ok(), Some(()));
    for bad in [25_001.0, f64::NAN, f64::NEG_INFINITY] {
        assert!(
            check_time(scene.as_ref(), "t", bad).unwrap_err().to_string().starts_with("t: expected a time in frames")
        );
    }
    assert!(truth(scene.as_ref(), f64::NAN).unwrap_err().to_string().starts_with("t: expected a finite time"));
}
