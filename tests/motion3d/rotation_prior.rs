//! A rotation known beforehand that the flow speaks against.

use super::scenes::{Held, Scene, oblique, smooth};
use jacoflow::math::random::CounterRng;
use jacoflow::motion3d::*;
use nalgebra::Vector3;

/// Deviation of the known rotation, about that of the flow's own.
const DEVIATION: f64 = 0.003;

/// A scene, and its rotation as it is known: by chance, and in addition `off` deviations beside.
fn estimate_with_prior(seed: u64, off: f64) -> (Scene, RotationPrior) {
    let scene = Scene::new(oblique(), 300, 0.6, 0.01, seed, |x, y, _| smooth(x, y));
    let rng = CounterRng::new(seed).stream(9);
    let axis = |j: u64| Vector3::from_fn(|i, _| rng.normal(3 * j + i as u64));
    let away = axis(0) + axis(1).normalize() * off;
    let rotation = Vector3::from(scene.motion.rotation) + away * DEVIATION;
    let covariance = std::array::from_fn(|i| std::array::from_fn(|j| if i == j { DEVIATION.powi(2) } else { 0.0 }));
    (scene, RotationPrior { rotation: rotation.into(), covariance })
}

#[test]
fn flow_that_speaks_against_a_known_rotation_is_reported() {
    for (method, robust, known) in [
        (Method::Efficient, false, true),
        (Method::MaximumLikelihood, false, true),
        (Method::Efficient, true, true),
        (Method::Efficient, false, false),
    ] {
        let run = |scene: &Scene, rotation_prior| {
            let options =
                MotionOptions { method, robust, rotation_prior, placement: Placement::Start, ..Default::default() };
            let noise = if known { Noise::StandardDeviation(scene.noise_std) } else { Noise::Unknown };
            estimate_motion(&scene.flow(), &noise, &options).unwrap()
        };
        let (mut wide, mut nearer) = (Held::default(), 0);
        for seed in 0..20 {
            let (scene, prior) = estimate_with_prior(seed, 0.0);
            let found = run(&scene, Some(prior));
            assert_eq!(found.status, Status::Ok, "{method:?} {robust} {known} {seed}");
            let (scene, prior) = estimate_with_prior(seed, 15.0);
            let found = run(&scene, Some(prior));
            assert_eq!(found.status, Status::Ambiguous, "{method:?} {robust} {known} {seed}");
            wide.count(&found, &scene.motion);
            // The motion of the flow alone is an alternative.
            let alone = found
                .alternatives
                .iter()
                .map(|other| other.motion.angle_to(&scene.motion))
                .fold(f64::INFINITY, f64::min);
            nearer += u32::from(alone < found.motion.angle_to(&scene.motion));
        }
        assert!(wide.share() >= 0.5 && nearer >= 16, "{method:?} {robust} {known}: {} {nearer}", wide.share());
    }
}

/// A wrong rotation is no noise of the flow, and no reason to see no translation.
#[test]
fn a_wrong_rotation_hides_no_translation_in_unknown_noise() {
    for seed in 0..10 {
        let (scene, prior) = estimate_with_prior(seed, 50.0);
        let options =
            MotionOptions { rotation_prior: Some(prior), placement: Placement::Start, ..MotionOptions::default() };
        let found = estimate_motion(&scene.flow(), &Noise::Unknown, &options).unwrap();
        assert_eq!(found.status, Status::Ambiguous, "{seed}");
    }
}

/// The more precise a wrong rotation is, the larger residuals it leaves: they are no reason to hear the
/// flow less.
#[test]
fn a_wrong_rotation_that_is_given_surely_does_not_hide_itself() {
    for noise in [Noise::StandardDeviation(0.01), Noise::Unknown] {
        for deviation in [1e-3, 1e-4, 1e-5] {
            for seed in 0..10 {
                let (scene, mut prior) = estimate_with_prior(seed, 15.0);
                let shape = |i: usize, j: usize| if i == j { deviation * deviation } else { 0.0 };
                prior.covariance = std::array::from_fn(|i| std::array::from_fn(|j| shape(i, j)));
                let options = MotionOptions {
                    rotation_prior: Some(prior),
                    placement: Placement::Start,
                    ..MotionOptions::default()
                };
                let found = estimate_motion(&scene.flow(), &noise, &options).unwrap();
                assert_ne!(found.status, Status::Ok, "{noise:?} {deviation} {seed}");
            }
        }
    }
}

/// Of a rotation alone there is no direction to be unsure of: the covariance says it.
#[test]
fn a_rotation_alone_that_speaks_against_the_known_one_is_as_unsure() {
    let still = |seed| Scene::new(oblique(), 300, 0.6, 0.01, seed, |_, _, _| 0.0);
    for seed in 0..10 {
        let (scene, (_, prior)) = (still(seed), estimate_with_prior(seed, 15.0));
        let run = |rotation_prior| {
            let options = MotionOptions { rotation_prior, placement: Placement::Start, ..MotionOptions::default() };
            estimate_motion(&scene.flow(), &Noise::Unknown, &options).unwrap()
        };
        let (found, alone) = (run(Some(prior)), run(None));
        assert_eq!((found.status, alone.status), (Status::RotationOnly, Status::RotationOnly), "{seed}");
        let (told, own) = (Vector3::from(found.alternatives[0].motion.rotation), Vector3::from(alone.motion.rotation));
        assert!((told - own).norm() < 0.2 * DEVIATION && found.alternatives[0].excess > 0.0, "{told} {own}");
        let off = Vector3::from(found.motion.rotation) - Vector3::from(scene.motion.rotation);
        let spread = nalgebra::Matrix3::from_fn(|i, j| found.covariance[2 + i][2 + j]);
        assert!(off.dot(&(spread.try_inverse().unwrap() * off)) < 16.0, "{seed}: {off}");
    }
}
