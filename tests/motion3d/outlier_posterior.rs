//! Outliers that fit by chance, and inliers whose depths look like theirs.

use super::scenes::{Scene, mahalanobis};
use jacoflow::math::random::CounterRng;
use jacoflow::motion3d::*;

/// A motion by chance, of points with depths from 0.5 to 1.5 of which a share has any flow up to four times
/// the others'; noise in shares of that.
fn among_outliers(outliers: f64, noise: f64, seed: u64) -> Scene {
    let rng = CounterRng::new(7000 + seed);
    let normal = |k: u64| [0, 1, 2].map(|j| rng.normal(3 * k + j));
    let motion = Motion::new(normal(0), [0, 1, 2].map(|j| 0.08 * rng.uniform(50 + j) - 0.04));
    let still = Motion { rotation: [0.0; 3], ..motion };
    let mut sizes: Vec<f64> = Scene::new(still, 1000, 0.6, 0.0, seed, |_, _, r| 0.5 + r)
        .flow
        .iter()
        .map(|flow| flow[0].hypot(flow[1]))
        .collect();
    sizes.sort_by(f64::total_cmp);
    let size = sizes[500];
    let mut scene = Scene::new(motion, 1000, 0.6, noise * size, seed, |_, _, r| 0.5 + r);
    let wrong = rng.stream(1);
    for k in 0..(1000.0 * outliers) as usize {
        scene.flow[k] = [0, 1].map(|j| 4.0 * size * (2.0 * wrong.uniform(2 * k as u64 + j) - 1.0));
    }
    scene
}

/// Outliers that fit by chance carry no information, however large their apparent depths.
#[test]
fn outliers_that_fit_by_chance_are_in_the_covariance() {
    let options = MotionOptions { placement: Placement::Start, robust: true, ..MotionOptions::default() };
    for (outliers, noise) in [(0.4, 0.2), (0.6, 0.2)] {
        let (mut sure, mut inside) = (0, 0);
        for seed in 0..60 {
            let scene = among_outliers(outliers, noise, seed);
            let found = estimate_motion(&scene.flow(), &Noise::StandardDeviation(scene.noise_std), &options).unwrap();
            if found.status == Status::Ok {
                sure += 1;
                inside += u32::from(mahalanobis(&found, &scene.motion) < 11.07);
            }
        }
        assert!(sure >= 25 && inside * 100 >= sure * 84, "{outliers} {noise}: {inside} of {sure}");
    }
}

/// Few near objects before a far background carry all of the translation: an odd depth is no outlier
/// where no outliers are.
#[test]
fn few_near_points_before_a_far_background_stay() {
    let motion = Motion::new([0.6, 0.2, 0.75], [0.01, -0.015, 0.005]);
    for share in [0.05, 0.15] {
        let (mut plain, mut robust) = (0.0, 0.0);
        for seed in 0..20 {
            let depth = |_: f64, _: f64, r: f64| if r < share { 0.04 } else { 0.002 + 0.002 * r };
            let scene = Scene::new(motion, 600, 0.6, 0.0004, seed, depth);
            for (robustly, sum) in [(false, &mut plain), (true, &mut robust)] {
                let options =
                    MotionOptions { placement: Placement::Start, robust: robustly, ..MotionOptions::default() };
                let found =
                    estimate_motion(&scene.flow(), &Noise::StandardDeviation(scene.noise_std), &options).unwrap();
                *sum += found.motion.angle_to(&motion).to_degrees().powi(2);
            }
        }
        assert!(robust < 1.5 * plain, "{share}: {robust} {plain}");
    }
}
