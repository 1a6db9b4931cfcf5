//! Depths that are mostly noise hide the truth behind a lower minimum: that must not be reported as `ok`.

use super::scenes::{Scene, ground};
use jacoflow::motion3d::*;

/// How many of the estimates are `ok`, and how many of those off by more than four deviations and 15 degrees.
fn counts(trials: u64, scene: impl Fn(u64) -> Scene) -> (u32, u32) {
    let options = MotionOptions { placement: Placement::Start, ..MotionOptions::default() };
    let (mut confident, mut wrong) = (0, 0);
    for seed in 0..trials {
        let scene = scene(7000 + seed);
        let found = estimate_motion(&scene.flow(), &Noise::StandardDeviation(scene.noise_std), &options).unwrap();
        let error = found.motion.angle_to(&scene.motion).to_degrees();
        let ok = found.status == Status::Ok;
        confident += u32::from(ok);
        wrong += u32::from(ok && error > 15.0 && error > 4.0 * found.direction_std);
    }
    (confident, wrong)
}

/// Of depths near 0 half are behind the camera by noise alone, and a wrong motion may have fewer of
/// them.
#[test]
fn a_ground_ahead_in_noise_as_large_as_its_flow_is_not_reported_wrong_as_ok() {
    let ahead = Motion::new([0.06, -0.05, 1.0], [0.02, -0.03, 0.01]);
    for (n, noise_std) in [(1000, 0.3), (6000, 0.2)] {
        let (_, wrong) = counts(15, |seed| Scene::new(ahead, n, 0.5, noise_std, seed, |_, y, _| ground(y)));
        assert!(wrong <= 1, "{n} {noise_std}: {wrong}");
    }
    let (confident, wrong) = counts(15, |seed| Scene::new(ahead, 1000, 0.5, 0.1, seed, |_, y, _| ground(y)));
    assert!(confident >= 8 && wrong == 0, "{confident} {wrong}");
}
