//! Band-limited noise under a steady affine motion: the scene on which affine estimators are measured.

use super::scene_conformance as conformance;
use jacoflow::parallel::Threads;
use jacoflow::synth::{AffineTexture, Scene, truth};

#[test]
fn brightness_is_constant_along_the_true_motion() {
    conformance::check(&AffineTexture::reference(64, 48, 3).unwrap(), 1e-4);
}

#[test]
fn truth_is_the_affine_field_and_steady() {
    let scene = AffineTexture::reference(65, 65, 3).unwrap();
    let field = truth(&scene, 5.0).unwrap();
    assert_eq!(field.affine(32 * 65 + 32).to_array(), [0.3, -0.2, 0.01, 0.02, -0.02, 0.01]);
    let corner = field.affine(0);
    assert!((corner.u - (0.3 - 0.32 + 0.64)).abs() < 1e-12 && (corner.v - (-0.2 - 0.64 - 0.32)).abs() < 1e-12);
    assert_eq!(scene.motion(3.0, 4.0, 0.0), scene.motion(3.0, 4.0, 9.0));
}

#[test]
fn a_seed_gives_the_same_bits_on_any_number_of_threads() {
    let scene = AffineTexture::reference(70, 50, 8).unwrap();
    let one = Threads::new(Some(1)).unwrap().install(|| scene.frame(3.0));
    let three = Threads::new(Some(3)).unwrap().install(|| AffineTexture::reference(70, 50, 8).unwrap().frame(3.0));
    assert_eq!(one, three);
    assert_ne!(one, AffineTexture::reference(70, 50, 9).unwrap().frame(3.0));
}
