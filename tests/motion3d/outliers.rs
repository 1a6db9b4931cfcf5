//! Few points with outliers: what a doubtful choice of them leaves must be reported.

use super::scenes::{Scene, mahalanobis};
use jacoflow::math::random::CounterRng;
use jacoflow::motion3d::*;

fn options() -> MotionOptions {
    MotionOptions { robust: true, placement: Placement::Start, ..MotionOptions::default() }
}

/// Few points in the oblique motion, of which the first `outliers` have any flow up to `reach`.
fn with_outliers(n: usize, outliers: usize, noise_std: f64, reach: f64, seed: u64) -> Scene {
    let (mut scene, rng) = (Scene::oblique(n, noise_std, seed), CounterRng::new(900 + seed));
    for (k, flow) in scene.flow.iter_mut().take(outliers).enumerate() {
        *flow = [0, 1].map(|j| reach * (2.0 * rng.uniform(2 * k as u64 + j) - 1.0));
    }
    scene
}

/// Of so few points no status is `ok`.
#[test]
fn a_handful_of_points_is_no_reason_to_stop() {
    for n in 0..16 {
        for seed in 0..8 {
            let scene = with_outliers(n, n / 3, 0.02, 1.0, seed);
            for noise in [Noise::Unknown, Noise::StandardDeviation(0.02)] {
                let found = estimate_motion(&scene.flow(), &noise, &options()).unwrap();
                assert!(n >= 12 || found.status != Status::Ok, "{n}: {:?}", found.status);
            }
        }
    }
}

/// A few of few points always agree by chance: where the noise is not known, it must not be theirs.
#[test]
fn few_points_do_not_choose_their_own_noise() {
    let (mut confident, mut wrong, mut small) = (0, 0, 0);
    for seed in 0..240 {
        let scene = Scene::oblique(20, 0.1, seed);
        let found = estimate_motion(&scene.flow(), &Noise::Unknown, &options()).unwrap();
        if found.status == Status::Ok {
            confident += 1;
            wrong += u32::from(mahalanobis(&found, &scene.motion) > 45.0);
            small += u32::from(found.noise_std < 0.05);
        }
    }
    assert!(confident >= 60 && wrong <= 12 && small <= 4, "{wrong} and {small} of {confident}");
    // Outliers that are far out are seen all the same.
    let mut right = 0;
    for seed in 0..20 {
        let scene = with_outliers(40, 8, 0.02, 4.0, seed);
        let found = estimate_motion(&scene.flow(), &Noise::Unknown, &options()).unwrap();
        right += u32::from(found.status == Status::Ok && (0.012..0.03).contains(&found.noise_std));
    }
    assert!(right >= 18, "{right} of 20");
}

/// Among few points, outliers that fit by chance can decide: a known noise does not show them.
#[test]
fn few_points_with_outliers_are_reported_in_known_noise_too() {
    let (mut confident, mut wrong) = (0, 0);
    for seed in 0..100 {
        let scene = with_outliers(20, 8, 0.1, 2.5, seed);
        let found = estimate_motion(&scene.flow(), &Noise::StandardDeviation(0.1), &options()).unwrap();
        if found.status == Status::Ok {
            confident += 1;
            wrong += u32::from(mahalanobis(&found, &scene.motion) > 20.5);
        }
    }
    assert!(wrong <= 15, "{wrong} of {confident}");
    // Where outliers are far out, little is given up.
    let mut right = 0;
    for seed in 0..40 {
        let scene = with_outliers(50, 20, 0.02, 2.5, seed);
        let found = estimate_motion(&scene.flow(), &Noise::StandardDeviation(0.02), &options()).unwrap();
        right += u32::from(found.status == Status::Ok && mahalanobis(&found, &scene.motion) < 20.5);
    }
    assert!(right >= 36, "{right} of 40");
}

/// A rotation that a doubtful choice of few points leaves is no surer than a motion would be.
#[test]
fn no_translation_is_not_reported_of_few_points_with_outliers() {
    let (mut still, mut told) = (0, 0);
    for seed in 200..260 {
        let scene = with_outliers(20, 8, 0.1, 2.5, seed);
        let found = estimate_motion(&scene.flow(), &Noise::Unknown, &options()).unwrap();
        still += u32::from(matches!(found.status, Status::RotationOnly | Status::LowSnr));
        told += u32::from(found.status == Status::FewPoints);
    }
    assert!(still <= 6 && told >= 30, "{still} {told}");
}
