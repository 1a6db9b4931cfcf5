//! What is not known must not be told as `ok`.

use super::super::*;
use super::estimators::mahalanobis;
use super::scenes::Scene;
use crate::math::random::CounterRng;

fn options() -> MotionOptions {
    MotionOptions { placement: Placement::Start, ..MotionOptions::default() }
}

fn run(scene: &Scene, noise: &Noise<'_>) -> MotionEstimate {
    estimate_motion(&scene.flow(), noise, &options()).unwrap()
}

const W: [f64; 3] = [0.02, -0.03, 0.01];

fn smooth(x: f64, y: f64) -> f64 {
    1.0 + 0.35 * (2.0 * x + 1.0).sin() * (1.5 * y).cos() + 0.15 * y
}

/// Few points in the oblique motion, of which the first `outliers` have any flow up to `reach`.
fn with_outliers(n: usize, outliers: usize, sigma: f64, reach: f64, seed: u64) -> Scene {
    let (mut scene, rng) = (Scene::oblique(n, sigma, seed), CounterRng::new(900 + seed));
    for (k, flow) in scene.flow.iter_mut().take(outliers).enumerate() {
        *flow = [0, 1].map(|j| reach * (2.0 * rng.uniform(2 * k as u64 + j) - 1.0));
    }
    scene
}

/// How many estimates are confident (`ok`), and how many of those are off by more than four deviations, with the truth outside of the ellipsoid that holds 0.999.
fn silently_wrong(trials: u64, scene: impl Fn(u64) -> Scene) -> (u32, u32) {
    let (mut confident, mut wrong) = (0u32, 0u32);
    for seed in 0..trials {
        let scene = scene(seed);
        let found = run(&scene, &Noise::Sigma(scene.sigma));
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
    let oblique = Motion::new([0.6, 0.2, 0.75], W);
    let lateral = Motion::new([1.0, 0.0, 0.0], [0.0; 3]);
    let (mut confident, mut wrong) = (0, 0);
    for (motion, h, n, sigma) in [
        (oblique, 0.02, 60, 0.1),
        (oblique, 0.1, 60, 0.01),
        (oblique, 0.1, 60, 0.03),
        (oblique, 0.1, 300, 0.01),
        (oblique, 0.2, 300, 0.03),
        (lateral, 0.05, 60, 0.01),
        (lateral, 0.05, 300, 0.03),
        (lateral, 0.1, 300, 0.1),
        (lateral, 0.2, 300, 0.1),
    ] {
        for depth in [false, true] {
            let (sure, off) = silently_wrong(40, |seed| {
                Scene::new(motion, n, h, sigma, seed, |x, y, r| if depth { smooth(x, y) } else { 0.5 + r })
            });
            confident += sure;
            wrong += off;
            assert!(off <= 3, "{motion:?} {h} {n} {sigma}: {off} of {sure}");
        }
    }
    assert!(confident > 300 && wrong * 100 <= 2 * confident, "{wrong} of {confident}");
}

/// A rotation that adds the same to all depths turns them round: in a narrow field a sideways motion has its opposite beside it.
#[test]
fn the_opposite_motion_is_told_where_depths_do_not_exclude_it() {
    let lateral = Motion::new([1.0, 0.0, 0.0], [0.0; 3]);
    for seed in 0..10 {
        let narrow = Scene::new(lateral, 300, 0.05, 0.03, seed, |_, _, r| 0.5 + r);
        let found = run(&narrow, &Noise::Sigma(0.03));
        assert!(matches!(found.status, Status::Ambiguous | Status::IllConditioned), "{seed}: {:?}", found.status);
        if found.status == Status::Ambiguous {
            let both = found.alternatives.iter().map(|other| other.motion).chain([found.motion]);
            let nearest = both.map(|motion| motion.angle_to(&lateral).to_degrees()).fold(f64::INFINITY, f64::min);
            assert!(nearest < 15.0, "{seed}: {nearest}");
        }
        let wide = Scene::new(lateral, 300, 0.6, 0.03, seed, |_, _, r| 0.5 + r);
        assert_eq!(run(&wide, &Noise::Sigma(0.03)).status, Status::Ok, "{seed}");
    }
}

/// Something large that overtakes moves along the camera's epipolar lines: together with the rest of the scene it can look like a sideways motion.
#[test]
fn a_robust_search_tells_what_else_many_points_obey() {
    let ahead = Motion::new([0.0, 0.0, -1.0], [0.0; 3]);
    let aside = Motion::new([-0.8, 0.1, 0.3], [0.0, 0.05, 0.02]);
    for seed in 0..10 {
        let mut scene = Scene::new(ahead, 600, 0.6, 0.01, seed, |_, _, r| 0.5 + r);
        let other = Scene::new(aside, 600, 0.6, 0.01, seed, |_, _, r| 0.5 + r);
        for k in 0..290 {
            scene.flow[k] = other.flow[k];
        }
        let found =
            estimate_motion(&scene.flow(), &Noise::Sigma(0.01), &MotionOptions { robust: true, ..options() }).unwrap();
        assert_eq!(found.status, Status::Ambiguous, "{seed}");
        for truth in [ahead, aside] {
            let both = found.alternatives.iter().map(|other| other.motion).chain([found.motion]);
            let nearest = both.map(|motion| motion.angle_to(&truth).to_degrees()).fold(f64::INFINITY, f64::min);
            assert!(nearest < 3.0, "{seed}: {nearest}");
        }
        // A thing of a quarter of the points that overtakes leaves no doubt.
        let overtaking = Motion::new([0.0, 0.0, 1.0], [0.0; 3]);
        let mut scene = Scene::new(ahead, 600, 0.6, 0.01, seed, |_, _, r| 0.5 + r);
        let truck = Scene::new(overtaking, 600, 0.6, 0.01, seed, |_, _, r| 0.5 + r);
        for k in (0..600).filter(|&k| scene.points[k][0] > 0.3) {
            scene.flow[k] = truck.flow[k];
        }
        let found =
            estimate_motion(&scene.flow(), &Noise::Sigma(0.01), &MotionOptions { robust: true, ..options() }).unwrap();
        assert!(found.motion.angle_to(&ahead).to_degrees() < 2.0, "{seed}: {:?}", found.motion);
    }
}

/// A few of few points always agree by chance: where the noise is not known, it must not be theirs.
#[test]
fn few_points_do_not_choose_their_own_noise() {
    let options = MotionOptions { robust: true, ..options() };
    for n in [20, 30] {
        let (mut confident, mut wrong, mut small) = (0, 0, 0);
        for seed in 0..60 {
            let scene = Scene::oblique(n, 0.1, seed);
            let found = estimate_motion(&scene.flow(), &Noise::Unknown, &options).unwrap();
            if found.status == Status::Ok {
                confident += 1;
                wrong += u32::from(mahalanobis(&found, &scene.motion) > 45.0);
                small += u32::from(found.sigma < 0.05);
            }
        }
        assert!(confident >= 15 && wrong <= 3 && small <= 1, "{n}: {wrong} and {small} of {confident}");
    }
    // Outliers that are far out are seen all the same.
    let mut right = 0;
    for seed in 0..20 {
        let scene = with_outliers(40, 8, 0.02, 4.0, seed);
        let found = estimate_motion(&scene.flow(), &Noise::Unknown, &options).unwrap();
        right += u32::from(found.status == Status::Ok && (0.012..0.03).contains(&found.sigma));
    }
    assert!(right >= 18, "{right} of 20");
}

/// Two minima of one scene are as hard to tell for maximum likelihood as they are for the smoothed weights.
#[test]
fn maximum_likelihood_tells_of_other_minima_too() {
    let (mut undecided, mut sure) = (0, 0);
    for seed in 0..150 {
        let rng = CounterRng::new(4000 + seed);
        let normal = |k: u64| [0, 1, 2].map(|j| rng.normal(3 * k + j));
        let motion = Motion::new(normal(0), normal(1).map(|w| 0.02 * w));
        let scene = Scene::new(motion, 100, 0.6, 0.2, seed, |_, y, _| 0.3 + 1.2 * y.max(0.0));
        let status = |method| {
            let options = MotionOptions { method, ..options() };
            estimate_motion(&scene.flow(), &Noise::Sigma(0.2), &options).unwrap().status
        };
        if status(Method::Efficient) == Status::Ambiguous {
            undecided += 1;
            sure += u32::from(status(Method::MaximumLikelihood) == Status::Ok);
        }
    }
    assert!(undecided >= 15 && sure <= 2, "{sure} of {undecided}");
}

/// By name, maximum likelihood's own theory holds while the noise of the depths matters little; where the epipole may lie among noisy points it is told how far it is from the better solution.
#[test]
fn maximum_likelihood_tells_how_far_it_may_be() {
    let ground = |_: f64, y: f64, _: f64| 0.3 + 1.2 * y.max(0.0);
    let options = MotionOptions { method: Method::MaximumLikelihood, ..options() };
    type Depth<'a> = &'a dyn Fn(f64, f64, f64) -> f64;
    let cases: [(Motion, usize, f64, Depth<'_>); 4] = [
        (Motion::new([0.35, 0.25, 1.0], W), 1000, 0.15, &ground),
        (Motion::new([0.05, -0.03, 1.0], W), 500, 0.1, &ground),
        (Motion::new([0.05, -0.03, 1.0], W), 300, 0.05, &|x, y, _| smooth(x, y)),
        (Motion::new([0.6, 0.2, 0.75], W), 500, 0.1, &|_, _, r| 0.5 + r),
    ];
    for (case, (motion, n, sigma, depth)) in cases.into_iter().enumerate() {
        let (mut inside, mut by_theory, mut sure) = (0u32, 0u32, 0u32);
        for seed in 0..100 {
            let scene = Scene::new(motion, n, 0.6, sigma, seed, depth);
            let found = estimate_motion(&scene.flow(), &Noise::Sigma(sigma), &options).unwrap();
            if matches!(found.status, Status::Ok | Status::LowSnr) {
                let theory = MotionEstimate {
                    covariance: found.likelihood.covariance,
                    tangent: found.likelihood.tangent,
                    ..found.clone()
                };
                sure += 1;
                inside += u32::from(mahalanobis(&found, &motion) < 11.07);
                by_theory += u32::from(mahalanobis(&theory, &motion) < 11.07);
            }
        }
        let (share, alone) = (f64::from(inside) / f64::from(sure), f64::from(by_theory) / f64::from(sure));
        assert!(sure >= 50 && share >= 0.88, "{case}: {share} of {sure}");
        // The last case is what theory is made for.
        assert!(if case < 3 { alone < 0.8 } else { alone >= 0.88 }, "{case}: {alone}");
    }
}

/// The residuals that tell of other directions are maximum likelihood's, on a sample of the points.
#[test]
fn many_points_are_no_reason_for_doubt() {
    let oblique = Motion::new([0.6, 0.2, 0.75], W);
    let mut trusted = 0;
    for seed in 0..12 {
        let scene = Scene::new(oblique, 8000, 0.6, 0.2, seed, |x, y, _| smooth(x, y));
        let found = run(&scene, &Noise::Sigma(0.2));
        trusted += u32::from(found.status != Status::IllConditioned);
    }
    assert!(trusted >= 11, "{trusted} of 12");
}

/// With noisy depths the deviation of a thousand points grows faster than by the root of their number: what they leave in doubt is asked of more.
#[test]
fn what_a_thousand_of_the_points_leave_in_doubt_is_asked_of_more() {
    let forward = Motion::new([0.05, -0.03, 1.0], W);
    let (mut doubted, mut wrong) = (0, 0);
    for seed in 0..24 {
        let scene = Scene::new(forward, 5000, 0.6, 0.2, seed, |x, y, _| smooth(x, y));
        let found = run(&scene, &Noise::Sigma(0.2));
        doubted += u32::from(found.status == Status::IllConditioned);
        wrong += u32::from(found.status == Status::Ok && mahalanobis(&found, &forward) > 20.5);
    }
    assert!(doubted <= 5 && wrong <= 1, "{doubted} and {wrong} of 24");
}

/// Points of a mover that obey the scene's motion by chance lie together and pull the same way: with a slow mover that is not seen in their residuals.
#[test]
fn a_slow_mover_is_found_or_told() {
    let (camera, aside) = (Motion::new([0.6, 0.2, 0.75], [0.01, -0.015, 0.005]), [-0.8, 0.1, 0.3]);
    let options = MotionOptions { robust: true, ..options() };
    let (mut silent, mut trusted) = (0, 0);
    for seed in 0..12 {
        let scene = |moves: bool| {
            let depth = |x: f64, y: f64, _: f64| 0.0095 * smooth(x, y);
            let mut scene = Scene::new(camera, 1000, 0.6, 0.0006, seed, depth);
            let other = Motion::new(aside, [0.0, 0.01, 0.02]);
            let moving = Scene::new(other, 1000, 0.6, 0.0006, seed, |x, y, r| 1.5 * depth(x, y, r));
            for k in
                (0..1000).filter(|&k| moves && (scene.points[k][0] + 0.2).abs().max(scene.points[k][1].abs()) < 0.27)
            {
                scene.flow[k] = moving.flow[k];
            }
            scene
        };
        let run = |scene: &Scene| estimate_motion(&scene.flow(), &Noise::Sigma(0.0006), &options).unwrap();
        let found = run(&scene(true));
        silent += u32::from(found.status == Status::Ok && mahalanobis(&found, &camera) > 45.0);
        trusted += u32::from(run(&scene(false)).status == Status::Ok);
    }
    assert!(silent <= 2 && trusted >= 11, "{silent} {trusted}");
}

/// A fifth of the points moves by itself: some of them obey the camera's motion by chance, and pull it their way. They lie among rejected ones.
#[test]
fn points_among_rejected_ones_do_not_pull_the_motion() {
    let (camera, aside) = (Motion::new([0.6, 0.2, 0.75], [0.01, -0.015, 0.005]), [-0.8, 0.1, 0.3]);
    let options = MotionOptions { robust: true, ..options() };
    let (mut inside, mut sure, mut wrong) = (0, 0, 0);
    for seed in 0..100 {
        let depth = |x: f64, y: f64, _: f64| 0.0148 * smooth(x, y);
        let mut scene = Scene::new(camera, 1000, 0.6, 0.0006, seed, depth);
        let other = Motion::new(aside, [0.0, 0.01, 0.02]);
        let moving = Scene::new(other, 1000, 0.6, 0.0006, seed, |x, y, r| 1.5 * depth(x, y, r));
        let moves = |&k: &usize| (scene.points[k][0] + 0.24).abs().max((scene.points[k][1] - 0.04).abs()) < 0.27;
        let movers: Vec<usize> = (0..1000).filter(moves).collect();
        for &k in &movers {
            scene.flow[k] = moving.flow[k];
        }
        let found = estimate_motion(&scene.flow(), &Noise::Sigma(0.0006), &options).unwrap();
        if found.status == Status::Ok {
            sure += 1;
            inside += u32::from(mahalanobis(&found, &camera) < 11.07);
            wrong += (0..1000).filter(|k| found.inliers[*k] == movers.contains(k)).count();
            assert!((0..1000).all(|k| !found.inliers[k] || found.inverse_depth_smooth[k].is_finite()));
        }
    }
    let wrong = wrong as f64 / (1000.0 * f64::from(sure));
    // So slow a mover is hard to tell: with those points a quarter of the ellipsoids would not hold.
    assert!(sure >= 60 && inside * 100 >= sure * 85 && wrong < 0.02, "{inside} of {sure}, {wrong}");
}

/// Among few points, outliers that obey by chance can be those that decide: a known noise does not tell them.
#[test]
fn few_points_with_outliers_are_told_in_known_noise_too() {
    let options = MotionOptions { robust: true, ..options() };
    let (mut confident, mut wrong) = (0, 0);
    for seed in 0..100 {
        let scene = with_outliers(20, 8, 0.1, 2.5, seed);
        let found = estimate_motion(&scene.flow(), &Noise::Sigma(0.1), &options).unwrap();
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
        let found = estimate_motion(&scene.flow(), &Noise::Sigma(0.02), &options).unwrap();
        right += u32::from(found.status == Status::Ok && mahalanobis(&found, &scene.motion) < 20.5);
    }
    assert!(right >= 36, "{right} of 40");
}

/// A rotation that a doubtful choice of few points leaves is no surer than a motion would be.
#[test]
fn no_translation_is_not_told_of_few_points_with_outliers() {
    let options = MotionOptions { robust: true, ..options() };
    let (mut still, mut told) = (0, 0);
    for seed in 200..260 {
        let scene = with_outliers(20, 8, 0.1, 2.5, seed);
        let found = estimate_motion(&scene.flow(), &Noise::Unknown, &options).unwrap();
        still += u32::from(matches!(found.status, Status::RotationOnly | Status::LowSnr));
        told += u32::from(found.status == Status::FewPoints);
    }
    assert!(still <= 6 && told >= 30, "{still} {told}");
}
