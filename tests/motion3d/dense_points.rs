//! Points closer than their errors go together.

use super::scenes::{ELLIPSOID, Scene, mahalanobis, smooth};
use jacoflow::math::random::CounterRng;
use jacoflow::motion3d::*;

/// Points that share one error, and its deviation.
const SHARED: usize = 12;
const OWN: f64 = 0.01;

/// Points of which [`SHARED`] in a row have one error, and `scale` times the depths.
fn dense(motion: Motion, n: usize, scale: f64, seed: u64) -> Scene {
    let mut scene = Scene::new(motion, n, 0.6, 0.0, seed, |x, y, _| scale * smooth(x, y));
    let noise = CounterRng::new(700 + seed);
    for (k, flow) in scene.flow.iter_mut().enumerate() {
        for (j, flow) in flow.iter_mut().enumerate() {
            *flow += OWN * noise.normal((2 * (k / SHARED) + j) as u64);
        }
    }
    scene
}

/// As a field gives its points: with their errors' covariance times how many share it.
fn run(scene: &Scene, points_per_independent_sample: Option<f64>, robust: bool) -> MotionEstimate {
    let noise = Noise::StandardDeviation(OWN * (SHARED as f64).sqrt());
    let options = MotionOptions {
        placement: Placement::Start,
        robust,
        points_per_independent_sample,
        ..MotionOptions::default()
    };
    estimate_motion(&scene.flow(), &noise, &options).unwrap()
}

const ALL: Option<f64> = Some(SHARED as f64);

#[test]
fn outliers_are_judged_by_their_own_errors() {
    let motion = Motion::new([0.6, 0.2, 0.75], [0.02, -0.03, 0.01]);
    let (mut right, mut inside) = (0, 0);
    for seed in 0..40 {
        let mut scene = dense(motion, 960, 1.0, seed);
        let rng = CounterRng::new(900 + seed);
        for (k, flow) in scene.flow.iter_mut().enumerate().filter(|(k, _)| k % 6 == 0) {
            let (sin, cos) = (std::f64::consts::TAU * rng.uniform(k as u64)).sin_cos();
            *flow = [flow[0] + 9.0 * OWN * cos, flow[1] + 9.0 * OWN * sin];
        }
        let found = run(&scene, ALL, true);
        right += found.inliers.iter().step_by(6).filter(|inlier| !**inlier).count();
        inside += u32::from(mahalanobis(&found, &motion) < ELLIPSOID);
        let kept = found.inliers.iter().filter(|inlier| **inlier).count();
        assert!(kept > 700, "{seed}: {kept}");
    }
    // Those along their epipolar lines are inliers.
    assert!(right > 40 * 160 * 7 / 10, "{right}");
    assert!(inside >= 34, "{inside}");
}

#[test]
fn little_translation_is_distinguished_from_none() {
    let motion = Motion::new([0.6, 0.2, 0.75], [0.02, -0.03, 0.01]);
    let (mut found, mut without, mut none) = (0, 0, 0);
    for seed in 0..40 {
        let still = |points_per_independent_sample, scale| {
            let scene = dense(motion, 600, scale, seed);
            u32::from(run(&scene, points_per_independent_sample, false).status == Status::RotationOnly)
        };
        found += 1 - still(ALL, 3.0 * OWN);
        without += 1 - still(None, 3.0 * OWN);
        none += still(ALL, 0.0);
    }
    assert!(found >= 34 && without <= 2 && none >= 38, "{found} {without} {none}");
}

#[test]
fn what_points_share_is_a_number_and_their_noise_is_known() {
    let scene = Scene::oblique(50, 0.1, 1);
    let told = |noise: &Noise<'_>, points_per_independent_sample| {
        let options = MotionOptions {
            points_per_independent_sample: Some(points_per_independent_sample),
            ..MotionOptions::default()
        };
        estimate_motion(&scene.flow(), noise, &options).unwrap_err().to_string()
    };
    for wrong in [0.5, f64::NAN, f64::INFINITY] {
        assert!(told(&Noise::StandardDeviation(0.1), wrong).starts_with("points_per_independent_sample: "));
    }
    assert!(told(&Noise::Unknown, 2.0).starts_with("points_per_independent_sample: "));
}
