//! Scenes by name, for the binary and for Python.

use jacoflow::synth::registry::{CARRIERS, SCENES, SceneOptions, build};
use jacoflow::synth::{AffineTexture, Scene};

fn small(carrier: Option<&str>, values: &[(&str, f64)]) -> SceneOptions {
    SceneOptions {
        width: 40,
        height: 32,
        random_state: 5,
        carrier: carrier.map(String::from),
        values: values.iter().map(|(n, v)| ((*n).to_string(), *v)).collect(),
        ..SceneOptions::default()
    }
}

#[test]
fn every_scene_with_every_carrier_makes_finite_moving_frames_with_truth() {
    for kind in SCENES {
        let carriers: Vec<Option<&str>> =
            if kind.takes_carrier() { CARRIERS.iter().map(|c| Some(c.name)).collect() } else { vec![None] };
        for carrier in carriers {
            let scene = match build(kind.name, &small(carrier, &[])) {
                Ok(scene) => scene,
                Err(error) if kind.name == "disc" && carrier == Some("particles") => {
                    assert!(error.to_string().contains("carrier"));
                    continue;
                }
                Err(error) => panic!("{}: {error}", kind.name),
            };
            assert_eq!(scene.size(), (40, 32));
            let (first, second) = (scene.frame(0.0), scene.frame(1.0));
            assert!(first.data().iter().all(|v| v.is_finite()), "{}", kind.name);
            assert_ne!(first, second, "{} {carrier:?}", kind.name);
            assert!(scene.motion(11.0, 13.0, 0.5).is_some(), "{}", kind.name);
            assert!(scene.displacement(11.0, 13.0, 0.5, 1.0).is_some());
        }
    }
}

#[test]
fn defaults_of_the_affine_scene_are_the_reference_texture() {
    let (by_name, by_hand) = (build("affine", &small(None, &[])).unwrap(), AffineTexture::reference(40, 32, 5));
    assert_eq!(by_name.frame(2.0), by_hand.unwrap().frame(2.0));
}

#[test]
fn unknown_and_unusable_input_is_named() {
    let message = |name: &str, options: &SceneOptions| build(name, options).err().unwrap().to_string();
    assert!(message("spiral", &small(None, &[])).contains("vortex"));
    assert!(message("affine", &small(Some("foam"), &[])).contains("speckle"));
    assert!(message("ramp", &small(Some("noise"), &[])).contains("carrier"));
    assert!(message("vortex", &small(None, &[("swirl", 1.0)])).contains("circulation"));
    assert!(message("vortex", &small(None, &[("core", 0.0)])).contains("core"));
    assert!(message("plane", &small(None, &[("time_to_contact", 0.0)])).contains("time_to_contact"));
    assert!(message("affine", &small(None, &[("u", f64::INFINITY)])).contains('u'));
    assert!(message("affine", &SceneOptions { width: 0, ..small(None, &[]) }).contains("size"));
}

#[test]
fn names_are_unique_and_documented() {
    for kind in SCENES {
        assert_eq!(SCENES.iter().filter(|k| k.name == kind.name).count(), 1);
        for carrier in CARRIERS.iter().filter(|_| kind.takes_carrier()) {
            let all: Vec<_> = kind.parameters.iter().chain(carrier.parameters).collect();
            for parameter in &all {
                let same = all.iter().filter(|p| p.name == parameter.name).count();
                assert_eq!(same, 1, "{} of {} with {}", parameter.name, kind.name, carrier.name);
                assert!(!parameter.meaning.is_empty() && !kind.summary.is_empty());
            }
        }
    }
}
