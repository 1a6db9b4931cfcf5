//! Pictures that are narrow beside what is known of the direction, and minima that are narrow in the picture.

use super::scenes::{Held, Scene, ground, mahalanobis, oblique, smooth};
use jacoflow::math::random::CounterRng;
use jacoflow::motion3d::*;

type Depth<'a> = &'a dyn Fn(f64, f64, f64) -> f64;

/// How many 95 % ellipsoids of estimates with the status `ok` hold the truth.
fn held(motion: Motion, (h, n, noise_std): (f64, usize, f64), depth: Depth<'_>, trials: u64) -> Held {
    let mut held = Held::default();
    for seed in 0..trials {
        let scene = Scene::new(motion, n, h, noise_std, seed, depth);
        let found = scene.run(&MotionOptions::default());
        if found.status == Status::Ok {
            held.count(&found, &motion);
        }
    }
    held
}

/// Of each layout by itself: at an estimate that is off, the information promises much smaller errors.
#[test]
fn ellipsoids_hold_the_truth_in_narrow_fields() {
    let [sideways, across, down, straight] =
        [[1.0, 0.0, 0.0], [1.0, 0.1, 0.2], [0.1, 1.0, 0.2], [0.6, 0.2, 0.75]].map(|u| Motion::new(u, [0.0; 3]));
    let near: Depth<'_> = &|_, y, _| ground(y);
    for (motion, layout) in [
        (sideways, (0.25, 60, 0.03)),
        (sideways, (0.25, 200, 0.06)),
        (down, (0.15, 200, 0.03)),
        (across, (0.15, 200, 0.03)),
        (straight, (0.25, 200, 0.03)),
    ] {
        let held = held(motion, layout, near, 120);
        assert!(held.of >= 60 && (0.87..=0.99).contains(&held.share()), "{motion:?} {layout:?}: {held:?}");
    }
}

/// The same where the epipole may lie among noisy points, and of a wide field, of which nothing is added to
/// speak of.
#[test]
fn ellipsoids_hold_the_truth_around_the_epipole() {
    let [off, forward] = [[0.35, 0.25, 1.0], [0.05, -0.03, 1.0]].map(|u| Motion::new(u, [0.02, -0.03, 0.01]));
    let wall: Depth<'_> = &|x, y, _| smooth(x, y);
    for (motion, layout) in [(off, (0.6, 40, 0.03)), (off, (1.0, 300, 0.1)), (forward, (1.0, 300, 0.1))] {
        let held = held(motion, layout, wall, 120);
        assert!(held.of >= 50 && (0.87..=0.99).contains(&held.share()), "{motion:?} {layout:?}: {held:?}");
    }
    let held = held(oblique(), (0.6, 400, 0.03), &|_, _, r| 0.5 + r, 150);
    assert!(held.of >= 140 && (0.9..=0.985).contains(&held.share()), "{held:?}");
}

/// A motion forwards or backwards into a picture of 6 to 23 degrees, of which a search of the half sphere
/// sees a few directions only.
fn into_a_narrow_picture(seed: u64) -> Scene {
    let rng = CounterRng::new(9000 + seed);
    let h = 0.05 + 0.15 * rng.uniform(0);
    let [x, y] = [1, 2].map(|k| 3.0 * h * (rng.uniform(k) - 0.5));
    let motion = Motion::new([x, y, 1.0], [3, 4, 5].map(|k| 0.02 * (rng.uniform(k) - 0.5)));
    let noise_std = h * 0.001 * (3.4 * rng.uniform(6)).exp();
    Scene::new(motion, 200, h, noise_std, seed, |x, y, _| smooth(x, y))
}

#[test]
fn minima_within_narrow_pictures_are_found() {
    let mut sure = 0;
    for seed in 0..300 {
        let scene = into_a_narrow_picture(seed);
        let found = scene.run(&MotionOptions::default());
        if found.status == Status::Ok {
            sure += 1;
            let turned = found.motion.angle_to(&scene.motion) > 1.0;
            assert!(!turned && mahalanobis(&found, &scene.motion) < 45.0, "{seed}: {found:?}");
        }
    }
    assert!(sure >= 200, "{sure}");
}

/// Noise that is fifty times as large along one axis as along the other, as that of edges: valleys are as
/// much narrower.
#[test]
fn minima_under_noise_that_is_far_from_round_are_found() {
    let mut held = Held::default();
    for seed in 0..80 {
        let mut scene = Scene::new(oblique(), 150, 0.6, 0.0, seed, |_, _, r| 0.5 + r);
        let (rng, mut covariances) = (CounterRng::new(700 + seed), Vec::new());
        for (k, flow) in scene.flow.iter_mut().enumerate() {
            let k = 3 * k as u64;
            let (sin, cos) = (std::f64::consts::PI * rng.uniform(k)).sin_cos();
            let (long, short) = (0.05, 0.001);
            let (a, b) = (long * rng.normal(k + 1), short * rng.normal(k + 2));
            flow[0] += cos * a - sin * b;
            flow[1] += sin * a + cos * b;
            let mixed = sin * cos * (long * long - short * short);
            let (l2, s2) = (long * long, short * short);
            covariances.extend([cos * cos * l2 + sin * sin * s2, mixed, mixed, sin * sin * l2 + cos * cos * s2]);
        }
        let options = MotionOptions { placement: Placement::Start, ..MotionOptions::default() };
        let found = estimate_motion(&scene.flow(), &Noise::Covariances(&covariances), &options).unwrap();
        if found.status == Status::Ok {
            assert!(mahalanobis(&found, &scene.motion) < 45.0, "{seed}: {found:?}");
            held.count(&found, &scene.motion);
        }
    }
    assert!(held.of >= 65 && held.share() >= 0.87, "{held:?}");
}

/// Noise that is three times the given one makes errors three times as large, and the covariance nine times.
#[test]
fn residuals_that_the_given_noise_does_not_explain_widen_the_covariance() {
    let (mut held, mut factor) = (Held::default(), 0.0);
    for seed in 0..150 {
        let mut scene = Scene::oblique(200, 0.03, seed);
        let honest = scene.run(&MotionOptions::default());
        scene.noise_std = 0.01;
        let found = scene.run(&MotionOptions::default());
        held.count(&found, &scene.motion);
        factor += found.direction_std / honest.direction_std / 150.0;
    }
    assert!(held.honest() && (0.9..1.1).contains(&factor), "{held:?} {factor}");
}
