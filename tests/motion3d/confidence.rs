//! What is not known must not be reported as `ok`: lines of minima, opposite motions, samples of many points.

use super::scenes::{Scene, W, mahalanobis, oblique, smooth};
use jacoflow::motion3d::*;

/// How many estimates are confident (`ok`), and how many of those are off by more than four standard
/// deviations, with the truth outside of the ellipsoid that holds 0.999.
fn silently_wrong(trials: u64, scene: impl Fn(u64) -> Scene) -> (u32, u32) {
    let (mut confident, mut wrong) = (0u32, 0u32);
    for seed in 0..trials {
        let scene = scene(seed);
        let found = scene.run(&MotionOptions::default());
        if found.status == Status::Ok {
            let error = found.motion.angle_to(&scene.motion).to_degrees();
            confident += 1;
            wrong += u32::from(error > 4.0 * found.direction_std && mahalanobis(&found, &scene.motion) > 20.5);
        }
    }
    (confident, wrong)
}

#[test]
fn a_narrow_field_is_not_trusted() {
    let lateral = Motion::new([1.0, 0.0, 0.0], [0.0; 3]);
    let (mut confident, mut wrong) = (0, 0);
    for (motion, h, n, noise_std) in [
        (oblique(), 0.02, 60, 0.1),
        (oblique(), 0.1, 60, 0.01),
        (oblique(), 0.1, 60, 0.03),
        (oblique(), 0.1, 300, 0.01),
        (oblique(), 0.2, 300, 0.03),
        (lateral, 0.05, 60, 0.01),
        (lateral, 0.05, 300, 0.03),
        (lateral, 0.1, 300, 0.1),
        (lateral, 0.2, 300, 0.1),
    ] {
        for depth in [false, true] {
            let (sure, off) = silently_wrong(40, |seed| {
                Scene::new(motion, n, h, noise_std, seed, |x, y, r| if depth { smooth(x, y) } else { 0.5 + r })
            });
            confident += sure;
            wrong += off;
            assert!(off <= 3, "{motion:?} {h} {n} {noise_std}: {off} of {sure}");
        }
    }
    assert!(confident > 240 && wrong * 100 <= confident, "{wrong} of {confident}");
}

/// A rotation that adds the same to all depths turns them round: in a narrow field a sideways motion has its
/// opposite beside it.
#[test]
fn the_opposite_motion_is_reported_where_depths_do_not_exclude_it() {
    let lateral = Motion::new([1.0, 0.0, 0.0], [0.0; 3]);
    for seed in 0..10 {
        let narrow = Scene::new(lateral, 300, 0.05, 0.03, seed, |_, _, r| 0.5 + r);
        let found = narrow.run(&MotionOptions::default());
        assert!(matches!(found.status, Status::Ambiguous | Status::IllConditioned), "{seed}: {:?}", found.status);
        if found.status == Status::Ambiguous {
            let both = found.alternatives.iter().map(|other| other.motion).chain([found.motion]);
            let nearest = both.map(|motion| motion.angle_to(&lateral).to_degrees()).fold(f64::INFINITY, f64::min);
            assert!(nearest < 15.0, "{seed}: {nearest}");
        }
        let wide = Scene::new(lateral, 300, 0.6, 0.03, seed, |_, _, r| 0.5 + r);
        assert_eq!(wide.run(&MotionOptions::default()).status, Status::Ok, "{seed}");
    }
}

/// With noisy depths the deviation of a thousand points grows faster than by the root of their number: what
/// they leave in doubt is tested on more.
#[test]
fn what_a_thousand_of_the_points_leave_in_doubt_is_asked_of_more() {
    let forward = Motion::new([0.05, -0.03, 1.0], W);
    let (mut doubted, mut wrong) = (0, 0);
    for seed in 0..24 {
        let scene = Scene::new(forward, 5000, 0.6, 0.2, seed, |x, y, _| smooth(x, y));
        let found = scene.run(&MotionOptions::default());
        doubted += u32::from(found.status == Status::IllConditioned);
        wrong += u32::from(found.status == Status::Ok && mahalanobis(&found, &forward) > 20.5);
    }
    assert!(doubted <= 8 && wrong <= 1, "{doubted} and {wrong} of 24");
}
