//! Scenes with an object that moves by itself.

use super::scenes::{Scene, mahalanobis, smooth};
use jacoflow::math::random::CounterRng;
use jacoflow::motion3d::*;

fn options() -> MotionOptions {
    MotionOptions { robust: true, placement: Placement::Start, ..MotionOptions::default() }
}

/// A large object that overtakes moves along the camera's epipolar lines: together with the rest of the
/// scene it can look like a sideways motion.
#[test]
fn a_robust_search_shows_what_else_many_points_share() {
    let ahead = Motion::new([0.0, 0.0, -1.0], [0.0; 3]);
    let aside = Motion::new([-0.8, 0.1, 0.3], [0.0, 0.05, 0.02]);
    for seed in 0..10 {
        let mut scene = Scene::new(ahead, 600, 0.6, 0.01, seed, |_, _, r| 0.5 + r);
        let other = Scene::new(aside, 600, 0.6, 0.01, seed, |_, _, r| 0.5 + r);
        for k in 0..290 {
            scene.flow[k] = other.flow[k];
        }
        let found = estimate_motion(&scene.flow(), &Noise::StandardDeviation(0.01), &options()).unwrap();
        assert_eq!(found.status, Status::Ambiguous, "{seed}");
        for truth in [ahead, aside] {
            let both = found.alternatives.iter().map(|other| other.motion).chain([found.motion]);
            let nearest = both.map(|motion| motion.angle_to(&truth).to_degrees()).fold(f64::INFINITY, f64::min);
            assert!(nearest < 3.0, "{seed}: {nearest}");
        }
        // An object of a quarter of the points that overtakes leaves no doubt.
        let overtaking = Motion::new([0.0, 0.0, 1.0], [0.0; 3]);
        let mut scene = Scene::new(ahead, 600, 0.6, 0.01, seed, |_, _, r| 0.5 + r);
        let truck = Scene::new(overtaking, 600, 0.6, 0.01, seed, |_, _, r| 0.5 + r);
        for k in (0..600).filter(|&k| scene.points[k][0] > 0.3) {
            scene.flow[k] = truck.flow[k];
        }
        let found = estimate_motion(&scene.flow(), &Noise::StandardDeviation(0.01), &options()).unwrap();
        assert!(found.motion.angle_to(&ahead).to_degrees() < 2.0, "{seed}: {:?}", found.motion);
    }
}

/// Points of a moving object that fit the scene's motion by chance lie together and pull the same way: with a
/// slow mover that is not seen in their residuals.
#[test]
fn a_slow_mover_is_found_or_reported() {
    let (camera, aside) = (Motion::new([0.6, 0.2, 0.75], [0.01, -0.015, 0.005]), [-0.8, 0.1, 0.3]);
    let mut silent = 0;
    for seed in 0..12 {
        let depth = |x: f64, y: f64, _: f64| 0.0095 * smooth(x, y);
        let mut scene = Scene::new(camera, 1000, 0.6, 0.0006, seed, depth);
        let other = Motion::new(aside, [0.0, 0.01, 0.02]);
        let moving = Scene::new(other, 1000, 0.6, 0.0006, seed, |x, y, r| 1.5 * depth(x, y, r));
        for k in (0..1000).filter(|&k| (scene.points[k][0] + 0.2).abs().max(scene.points[k][1].abs()) < 0.27) {
            scene.flow[k] = moving.flow[k];
        }
        let found = estimate_motion(&scene.flow(), &Noise::StandardDeviation(0.0006), &options()).unwrap();
        silent += u32::from(found.status == Status::Ok && mahalanobis(&found, &camera) > 45.0);
    }
    assert!(silent <= 2, "{silent}");
}

/// A disc of 30 % of the points moves by itself, in unknown noise of a tenth of the flow: with the rest of
/// the scene it may fit a third motion, at which every search ends. The residuals there are little larger
/// than noise, but those of a part pull another way, and two motions explain the points better.
#[test]
fn what_an_object_and_the_scene_share_together_is_not_trusted() {
    let (noise_std, mut trusted, mut wrong) = (1e-3, 0, 0);
    for seed in 0..40 {
        let rng = CounterRng::new(seed).stream(7);
        let normal = |j: u64| std::array::from_fn(|i| rng.normal(3 * j + i as u64));
        let w = normal(1).map(|value: f64| 0.01 * value);
        let (camera, by_itself) = (Motion::new(normal(0), w), normal(2).map(|value: f64| 0.005 * value));
        let moving = Motion::new(normal(3), std::array::from_fn(|i| w[i] + by_itself[i]));
        let mut scene = Scene::new(camera, 600, 0.45, noise_std, seed, |x, y, _| 0.01 * smooth(x, y));
        let object = Scene::new(moving, 600, 0.45, noise_std, seed, |_, _, _| 0.012);
        let middle = [0.2 * rng.normal(50), 0.2 * rng.normal(51)];
        let away = |k: usize| (scene.points[k][0] - middle[0]).hypot(scene.points[k][1] - middle[1]);
        let mut nearest: Vec<usize> = (0..600).collect();
        nearest.sort_by(|&a, &b| away(a).total_cmp(&away(b)));
        for &k in &nearest[..180] {
            scene.flow[k] = object.flow[k];
        }
        let found = estimate_motion(&scene.flow(), &Noise::Unknown, &options()).unwrap();
        if found.status == Status::Ok {
            let off = found.motion.angle_to(&camera).to_degrees();
            trusted += 1;
            wrong += u32::from(off > 15.0 && off > 4.0 * found.direction_std);
        }
    }
    assert!(trusted >= 4 && wrong <= 1, "{wrong} of {trusted}");
}
