//! Scenes with exactly one right status.

use super::scenes::{Scene, W, oblique, smooth};
use jacoflow::motion3d::*;

/// With a known rotation the direction is seen by its smoothed weights, while of a part of these scenes
/// maximum likelihood's information is less than the depths' noise adds to it: these are `low_snr`, and no
/// others. (The direction's confidence interval may have no end in such noise: `ill_conditioned`; or another
/// minimum comes as close.)
#[test]
fn depths_that_are_mostly_noise_are_low_snr() {
    let forward = Motion::new([0.05, -0.03, 1.0], W);
    let covariance = std::array::from_fn(|i| std::array::from_fn(|j| if i == j { 1e-8 } else { 0.0 }));
    let rotation_prior = Some(RotationPrior { rotation: W, covariance });
    let options = MotionOptions { rotation_prior, ..MotionOptions::default() };
    let (mut low, mut other) = (0, 0);
    for seed in 0..40 {
        let found = Scene::new(forward, 300, 0.6, 0.6, seed, |x, y, _| smooth(x, y)).run(&options);
        let nothing_left = found.likelihood.covariance[0][0].is_nan();
        match found.status {
            Status::LowSnr => assert!(nothing_left, "{seed}"),
            Status::Ok => assert!(!nothing_left, "{seed}"),
            Status::IllConditioned | Status::Ambiguous => other += 1,
            status => panic!("{seed}: {status:?}"),
        }
        // What is reported instead, that of the smoothed weights, holds all the same.
        assert!(found.direction_std > 2.0 && found.motion.angle_to(&forward).to_degrees() < 4.0 * found.direction_std);
        low += u32::from(found.status == Status::LowSnr);
    }
    assert!((4..=36).contains(&low) && other <= 4, "{low} and {other} of 40");
}

#[test]
fn a_field_of_two_degrees_is_ill_conditioned() {
    let mut ill = 0;
    for seed in 0..30 {
        let scene = Scene::new(oblique(), 300, 0.02, 0.03, seed, |_, _, r| 0.5 + r);
        let status = scene.run(&MotionOptions::default()).status;
        // In such noise the depths may pass for a plane, which has two motions.
        assert!(matches!(status, Status::IllConditioned | Status::Ambiguous), "{seed}: {status:?}");
        ill += u32::from(status == Status::IllConditioned);
    }
    assert!(ill >= 26, "{ill} of 30");
}

/// At one place there are two numbers for five unknowns, with any given noise.
#[test]
fn one_place_is_ill_conditioned_without_a_covariance() {
    let points = [[0.2, -0.1]; 60];
    let flow: Vec<[f64; 2]> = (0..60).map(|k| oblique().plane_flow(points[k], 0.5 + k as f64 / 60.0)).collect();
    let given = Flow::Plane { points: &points, flow: &flow, camera: None };
    let options = MotionOptions { placement: Placement::Start, ..MotionOptions::default() };
    for noise in [Noise::StandardDeviation(1e-6), Noise::StandardDeviation(1e-3)] {
        let found = estimate_motion(&given, &noise, &options).unwrap();
        assert_eq!(found.status, Status::IllConditioned, "{noise:?}");
        assert!(found.direction_std.is_nan() && found.covariance[0][0].is_nan(), "{noise:?}");
    }
}

/// "Auto" smooths depths from 30 points on.
#[test]
fn thirty_points_are_enough_for_smoothed_weights() {
    for (n, smoothed) in [(12, false), (29, false), (30, true), (31, true)] {
        assert_eq!(Scene::oblique(n, 0.005, 3).run(&MotionOptions::default()).efficient, smoothed, "{n}");
        for (method, wanted) in [(Method::Efficient, true), (Method::MaximumLikelihood, false)] {
            let options = MotionOptions { method, ..MotionOptions::default() };
            assert_eq!(Scene::oblique(n, 0.005, 3).run(&options).efficient, wanted, "{n} {method:?}");
        }
    }
}

/// The lists of words beside the enum.
#[test]
fn statuses_are_listed_in_the_page_in_python_and_in_the_help() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |name: &str| std::fs::read_to_string(root.join(name)).unwrap();
    let help = read("src/cli/egomotion.rs");
    let help = help.lines().find(|line| line.trim_start().starts_with("status: ")).unwrap();
    let (page, python) = (read("docs/motion3d.md"), read("python/jacoflow/motion3d/_results.py"));
    for name in Status::ALL.map(Status::name) {
        assert!(page.contains(&format!("| `{name}` |")), "docs/motion3d.md: {name}");
        assert!(python.contains(&format!("\"{name}\"")), "_results.py: {name}");
        assert!(help.contains(name), "egomotion --help: {name}");
    }
}
