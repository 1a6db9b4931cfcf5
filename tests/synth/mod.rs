//! Scenes by name: the truth they tell must be the truth of the pictures they show, whatever the parameters.

mod affine_texture;
mod disc;
mod motion_affine;
mod motion_approach;
mod motion_conformance;
mod motion_shear;
mod motion_turbulence;
mod motion_vortex;
mod motion_waves;
mod particles;
mod ramp;
mod registry;
mod scene_conformance;
mod sensor;
mod targets;
mod texture_noise;
mod texture_speckle;
mod truth;

use jacoflow::synth::registry::{CARRIERS, SCENES};
use jacoflow::synth::{Scene, SceneOptions, build, truth};
use jacoflow::types::Status;
use proptest::prelude::*;

fn options(carrier: Option<&str>, seed: u64, values: &[(&str, f64)]) -> SceneOptions {
    SceneOptions {
        width: 48,
        height: 40,
        origin: (-5.0, 3.0),
        random_state: seed,
        carrier: carrier.map(String::from),
        values: values.iter().map(|(name, value)| ((*name).to_string(), *value)).collect(),
    }
}

/// Velocity against the displacement over a short time, and the Jacobian against differences of the velocity.
fn truth_is_consistent(scene: &dyn Scene, x: f64, y: f64, t: f64) {
    let h = 1e-4;
    let (Some(m), Some(there), Some(back)) =
        (scene.motion(x, y, t), scene.displacement(x, y, t, h), scene.displacement(x, y, t, -h))
    else {
        return;
    };
    let close = |got: f64, want: f64, what: &str| {
        assert!((got - want).abs() < 1e-5 * (1.0 + want.abs()), "{what} at ({x}, {y}): {got}, {want}");
    };
    close((there.0 - back.0) / (2.0 * h), m.u, "u");
    close((there.1 - back.1) / (2.0 * h), m.v, "v");
    let neighbours = [(h, 0.0), (-h, 0.0), (0.0, h), (0.0, -h)].map(|(dx, dy)| scene.motion(x + dx, y + dy, t));
    if let [Some(right), Some(left), Some(below), Some(above)] = neighbours {
        close((right.u - left.u) / (2.0 * h), m.u_x, "u_x");
        close((right.v - left.v) / (2.0 * h), m.v_x, "v_x");
        close((below.u - above.u) / (2.0 * h), m.u_y, "u_y");
        close((below.v - above.v) / (2.0 * h), m.v_y, "v_y");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn every_scene_is_consistent(seed in 0u64..1000, x in -5.0..43.0f64, y in 3.0..43.0f64, t in 0.0..5.0f64) {
        for kind in SCENES {
            // The motion is what is looked at; speckle is the quickest to make.
            let carrier = kind.takes_carrier().then_some("speckle");
            let scene = build(kind.name, &options(carrier, seed, &[])).unwrap();
            truth_is_consistent(scene.as_ref(), x, y, t);
        }
    }

    #[test]
    fn brightness_travels_with_an_affine_motion(
        seed in 0u64..1000,
        motion in prop::array::uniform6(-0.05..0.05f64),
        x in 0.0..40.0f64,
        y in 5.0..40.0f64,
    ) {
        let names = ["u", "v", "u_x", "v_x", "u_y", "v_y"];
        let values: Vec<_> = names.into_iter().zip(motion).collect();
        let scene = build("affine", &options(Some("speckle"), seed, &values)).unwrap();
        let (dx, dy) = scene.displacement(x, y, 1.0, 3.0).unwrap();
        prop_assert!((scene.brightness(x + dx, y + dy, 4.0) - scene.brightness(x, y, 1.0)).abs() < 1e-6);
    }
}

#[test]
fn a_window_shows_the_same_scene_wherever_it_lies() {
    for carrier in CARRIERS {
        let values = [("centre_x", 20.0), ("centre_y", 20.0)];
        let wide = build("vortex", &options(Some(carrier.name), 3, &values)).unwrap();
        let moved = SceneOptions { origin: (5.0, 10.0), ..options(Some(carrier.name), 3, &values) };
        let moved = build("vortex", &moved).unwrap();
        let (wide, moved) = (wide.frame(2.0), moved.frame(2.0));
        assert_eq!(wide.get(20, 17), moved.get(10, 10), "{}", carrier.name);
    }
}

#[test]
fn truth_fields_mark_what_has_none() {
    let scene = build("disc", &options(None, 1, &[("disc_radius", 12.0)])).unwrap();
    let field = truth(scene.as_ref(), 0.0).unwrap();
    let masked = field.status.iter().filter(|&&s| s == Status::Masked).count();
    assert!(masked > 150 && masked < 600, "{masked}");
    for (index, status) in field.status.iter().enumerate() {
        assert_eq!(field.affine(index).u.is_nan(), *status == Status::Masked);
    }
}
