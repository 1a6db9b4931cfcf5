//! Estimates that say nothing, or little, of the direction: no covariance may claim that they do.

use super::scenes::Scene;
use jacoflow::motion3d::*;

fn without_noise_std(scene: &Scene, robust: bool) -> MotionEstimate {
    let flow = scene.flow();
    let options = MotionOptions { placement: Placement::Start, robust, ..MotionOptions::default() };
    estimate_motion(&flow, &Noise::Unknown, &options).unwrap()
}

/// Five numbers leave no, one or two residuals of 5, 6 or 7 points: their variance has no variance.
#[test]
fn few_points_in_unknown_noise_have_no_covariance() {
    for n in 5..=9 {
        for seed in 0..20 {
            for robust in [false, true] {
                let found = without_noise_std(&Scene::oblique(n, 0.01, seed), robust);
                assert!(matches!(found.status, Status::FewPoints | Status::IllConditioned | Status::RotationOnly));
                if n <= 7 {
                    let unknown = [found.covariance, found.bound, found.likelihood.covariance];
                    assert!(found.direction_std.is_nan(), "{n} {seed}: {}", found.direction_std);
                    assert!(unknown.iter().flatten().flatten().all(|value| value.is_nan()), "{n} {seed}");
                }
            }
        }
    }
}

/// The same points in known noise keep theirs.
#[test]
fn few_points_in_known_noise_have_a_covariance() {
    for n in 6..=9 {
        let found = Scene::oblique(n, 0.01, 3).run(&MotionOptions::default());
        assert!(found.status == Status::FewPoints && found.direction_std.is_finite(), "{n}: {found:?}");
    }
}
