//! Every scene that does not determine a motion, by its status.

use super::scenes::{Scene, W};
use jacoflow::math::random::CounterRng;
use jacoflow::motion3d::*;
use nalgebra::Vector3;

fn options() -> MotionOptions {
    MotionOptions { placement: Placement::Start, ..MotionOptions::default() }
}

fn run(scene: &Scene, noise: &Noise<'_>) -> MotionEstimate {
    estimate_motion(&scene.flow(), noise, &options()).unwrap()
}

#[test]
fn too_few_points_are_reported() {
    let scene = Scene::oblique(4, 0.0, 1);
    let found = run(&scene, &Noise::StandardDeviation(1e-3));
    assert_eq!(found.status, Status::TooFewPoints);
    assert!(found.motion.translation[0].is_nan() && found.inverse_depth.len() == 4);
    let none = Flow::Plane { points: &[], flow: &[], camera: None };
    assert_eq!(estimate_motion(&none, &Noise::Unknown, &options()).unwrap().status, Status::TooFewPoints);
    let few = run(&Scene::oblique(8, 0.0, 1), &Noise::StandardDeviation(1e-6));
    assert_eq!(few.status, Status::FewPoints);
}

#[test]
fn lengths_and_values_are_checked_by_name() {
    let scene = Scene::oblique(20, 0.1, 1);
    let refused = |flow: &Flow<'_>, noise: &Noise<'_>, word: &str| {
        let error = estimate_motion(flow, noise, &options()).unwrap_err().to_string();
        assert!(error.starts_with(word), "{error}");
    };
    refused(&Flow::Plane { points: &scene.points, flow: &scene.flow[1..], camera: None }, &Noise::Unknown, "flow: ");
    for noise_std in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-300, 1e300] {
        refused(&scene.flow(), &Noise::StandardDeviation(noise_std), "noise_std: ");
    }
    refused(&scene.flow(), &Noise::Covariances(&[1.0; 7]), "cov: ");
    for wrong in [[-1.0, 0.0, 0.0, -1.0], [1.0, 0.0, 0.0, 0.0], [1.0, 0.5, 0.0, 1.0], [1.0, 2.0, 2.0, 1.0]] {
        refused(&scene.flow(), &Noise::Covariances(&wrong.repeat(20)), "cov: ");
    }
    refused(&Flow::Sphere { bearings: &[[1.0, 1.0, 0.0]], flow: &[[0.0; 3]] }, &Noise::Unknown, "points: ");
}

#[test]
fn a_camera_that_only_turns_or_stands_still() {
    for w in [W, [0.0; 3]] {
        let motion = Motion { translation: [0.0; 3], rotation: w };
        let mut scene = Scene::new(motion, 300, 0.6, 0.01, 5, |_, _, _| 0.0);
        for noise in [Noise::StandardDeviation(0.01), Noise::Unknown] {
            for robust in [false, true] {
                let options = MotionOptions { robust, ..options() };
                let found = estimate_motion(&scene.flow(), &noise, &options).unwrap();
                assert_eq!(found.status, Status::RotationOnly, "{noise:?} {robust}");
                assert!(found.motion.translation[0].is_nan() && found.inverse_depth[0] == 0.0);
                for j in 0..3 {
                    assert!((found.motion.rotation[j] - w[j]).abs() < 4.0 * found.rotation_std[j]);
                    assert!(found.rotation_std[j] > 0.0 && found.rotation_std[j] < 0.01);
                }
            }
        }
        // The same without noise.
        scene.flow = scene.points.iter().map(|&p| motion.plane_flow(p, 0.0)).collect();
        for robust in [false, true] {
            let options = MotionOptions { robust, ..options() };
            let exact = estimate_motion(&scene.flow(), &Noise::Unknown, &options).unwrap();
            assert_eq!(exact.status, Status::RotationOnly);
            assert!(exact.rotation_std.iter().all(|deviation| *deviation < 1e-9), "{robust}: {:?}", exact.rotation_std);
        }
    }
}

/// The unknown noise must not hide a translation, nor invent one, by the number of points.
#[test]
fn turning_is_distinguished_from_moving_in_unknown_noise() {
    for n in [20, 60, 200, 1000] {
        for seed in 0..10 {
            let turning = Scene::new(Motion { translation: [0.0; 3], rotation: W }, n, 0.6, 0.01, seed, |_, _, _| 0.0);
            assert_eq!(run(&turning, &Noise::Unknown).status, Status::RotationOnly, "{n} {seed}");
            let moving = Scene::oblique(n, 0.01, seed);
            assert_ne!(run(&moving, &Noise::Unknown).status, Status::RotationOnly, "{n} {seed}");
        }
    }
}

#[test]
fn a_plane_has_two_motions() {
    // The oblique motion with n . eta = 0.9 + 0.3 x - 0.2 y: both motions have the plane before the camera.
    let motion = Motion::new([0.6, 0.2, 0.75], W);
    let n = Vector3::new(0.3, -0.2, 0.9);
    let scene = Scene::new(motion, 400, 0.6, 0.005, 3, |x, y, _| 0.9 + 0.3 * 0.6 * x - 0.2 * 0.6 * y);
    let found = run(&scene, &Noise::StandardDeviation(0.005));
    assert_eq!(found.status, Status::Ambiguous);
    let twin = Motion::new(n.into(), (Vector3::from(W) + n.cross(&Vector3::from(motion.translation))).into());
    let both = [found.motion, found.alternatives[0].motion];
    for truth in [motion, twin] {
        let nearest = both.iter().map(|m| m.angle_to(&truth).to_degrees()).fold(f64::INFINITY, f64::min);
        assert!(nearest < 3.0, "{nearest}: {both:?}");
    }
    let between = |m: &Motion, r: [f64; 3]| (Vector3::from(m.rotation) - Vector3::from(r)).norm();
    assert!(between(&both[0], W).min(between(&both[1], W)) < 0.03);
    // Along the image plane the other motion has half of the points behind the camera.
    let lateral = Motion::new([1.0, 0.0, 0.0], [0.0; 3]);
    let scene = Scene::new(lateral, 400, 0.6, 0.005, 3, |x, y, _| 0.9 + 0.3 * 0.6 * x - 0.2 * 0.6 * y);
    let found = run(&scene, &Noise::StandardDeviation(0.005));
    assert_eq!(found.status, Status::Ok);
    assert!(found.motion.angle_to(&lateral).to_degrees() < 2.0);
}

/// Places by number.
type Layout<'a> = Box<dyn Fn(u64) -> [f64; 2] + 'a>;

/// Points at one place, at two, on a line through the epipole: fewer than five unknowns are determined,
/// whatever
/// noise seems to add.
#[test]
fn points_that_do_not_determine_all_unknowns() {
    let motion = Motion::new([0.6, 0.2, 0.75], W);
    let epipole = [0.8, 0.2 / 0.75];
    let rng = CounterRng::new(3);
    let layouts: [(&str, Layout<'_>); 4] = [
        ("one place", Box::new(|_| [0.2, -0.1])),
        ("two places", Box::new(|k| [[0.2, -0.1], [-0.3, 0.4]][k as usize % 2])),
        ("a line through the epipole", Box::new(|k| [0, 1].map(|i| rng.uniform(k) * epipole[i] * 0.8))),
        ("a field of a millionth", Box::new(|k| [1e-6 * rng.uniform(2 * k), 1e-6 * rng.uniform(2 * k + 1)])),
    ];
    for (name, place) in &layouts {
        for noise_std in [0.0, 0.01] {
            let points: Vec<[f64; 2]> = (0..400).map(place).collect();
            let noise = rng.stream(7);
            let flow: Vec<[f64; 2]> = (0..400)
                .map(|k| {
                    let exact = motion.plane_flow(points[k], 0.5 + rng.stream(1).uniform(k as u64));
                    [0, 1].map(|j| exact[j] + noise_std * noise.normal(2 * k as u64 + j as u64))
                })
                .collect();
            let flow = Flow::Plane { points: &points, flow: &flow, camera: None };
            for given in [Noise::StandardDeviation(if noise_std > 0.0 { noise_std } else { 1e-6 }), Noise::Unknown] {
                for robust in [false, true] {
                    let found = estimate_motion(&flow, &given, &MotionOptions { robust, ..options() }).unwrap();
                    let told = matches!(found.status, Status::IllConditioned | Status::Ambiguous);
                    let told = told || *name == "a field of a millionth" && found.status == Status::RotationOnly;
                    assert!(
                        told,
                        "{name}, noise_std {noise_std}, {given:?}, robust {robust}: {:?} {}",
                        found.status, found.direction_std
                    );
                }
            }
        }
    }
}

/// Flow that is the same everywhere is a sideways motion before a wall, whose other motion has half of it
/// behind the camera; no rotation makes it over so wide a field. None at all is none.
#[test]
fn the_same_flow_everywhere() {
    let points = Scene::oblique(200, 0.0, 3).points;
    for flow in [[0.0, 0.0], [0.3, 0.0], [0.0, -0.2]] {
        let all = vec![flow; 200];
        let given = Flow::Plane { points: &points, flow: &all, camera: None };
        for noise in [Noise::StandardDeviation(0.01), Noise::Unknown] {
            for robust in [false, true] {
                let found = estimate_motion(&given, &noise, &MotionOptions { robust, ..options() }).unwrap();
                if flow == [0.0, 0.0] {
                    assert_eq!(found.status, Status::RotationOnly, "{noise:?} {robust}");
                } else {
                    assert_eq!(found.status, Status::Ok, "{flow:?} {noise:?} {robust}");
                    assert!(found.alternatives.is_empty());
                    let along = Motion::new([flow[0], flow[1], 0.0], [0.0; 3]);
                    assert!(found.motion.angle_to(&along) < 1e-9, "{:?}", found.motion);
                }
            }
        }
    }
}

#[test]
fn noise_as_large_as_the_flow_is_reported() {
    let scene = Scene::oblique(60, 0.6, 8);
    let found = run(&scene, &Noise::StandardDeviation(0.6));
    assert!(
        matches!(found.status, Status::IllConditioned | Status::LowSnr | Status::RotationOnly | Status::Ambiguous),
        "{:?}",
        found.status
    );
    assert!(found.status == Status::RotationOnly || found.direction_std.is_finite());
}

#[test]
fn what_is_not_finite_changes_nothing_else() {
    let scene = Scene::oblique(200, 0.02, 7);
    let want = run(&scene, &Noise::StandardDeviation(0.02));
    let mut dirty = scene.clone();
    for (k, (point, flow)) in
        [([f64::NAN, 0.0], [1.0, 1.0]), ([0.1, 0.1], [f64::INFINITY, 0.0])].into_iter().enumerate()
    {
        dirty.points.insert(10 * k, point);
        dirty.flow.insert(10 * k, flow);
    }
    let got = run(&dirty, &Noise::StandardDeviation(0.02));
    assert_eq!(got.motion, want.motion);
    assert!(got.inverse_depth[0].is_nan() && got.residuals[10].is_nan() && !got.inliers[10] && got.inliers[1]);
}

#[test]
fn a_point_on_the_epipole_has_no_weight() {
    let motion = Motion::new([0.05, -0.03, 1.0], W);
    let scene = Scene::new(motion, 200, 0.6, 0.0, 7, |_, _, r| 0.5 + r);
    let mut with = scene.clone();
    let epipole = [0.05, -0.03];
    with.points.push(epipole);
    with.flow.push(motion.plane_flow(epipole, 3.0));
    let found = run(&with, &Noise::StandardDeviation(1e-6));
    assert!(found.motion.angle_to(&motion) < 1e-6, "{}", found.motion.angle_to(&motion));
    assert!(found.covariance.iter().flatten().all(|value| value.is_finite()));
}

#[test]
fn points_on_one_line_are_enough() {
    let motion = Motion::new([0.6, 0.2, 0.75], W);
    let rng = CounterRng::new(3);
    let points: Vec<[f64; 2]> = (0..200).map(|k| 1.2 * rng.uniform(k) - 0.6).map(|x| [x, 0.3 * x + 0.1]).collect();
    let flow: Vec<[f64; 2]> =
        points.iter().enumerate().map(|(k, &p)| motion.plane_flow(p, 0.5 + rng.stream(1).uniform(k as u64))).collect();
    let found = estimate_motion(
        &Flow::Plane { points: &points, flow: &flow, camera: None },
        &Noise::StandardDeviation(1e-6),
        &options(),
    )
    .unwrap();
    assert!(found.motion.angle_to(&motion) < 1e-4, "{}", found.motion.angle_to(&motion));
}

/// Two planes or a quadric through the camera centre break methods that solve eight linear equations.
#[test]
fn two_planes_are_no_trap() {
    let motion = Motion::new([0.6, 0.2, 0.75], W);
    let scene = Scene::new(motion, 300, 0.6, 0.0, 7, |x, _, _| if x < 0.0 { 0.8 } else { 0.8 + 0.5 * x });
    let found = run(&scene, &Noise::StandardDeviation(1e-6));
    assert!(found.motion.angle_to(&motion) < 1e-4, "{:?}", found.motion);
}

/// `a . X = X^t Q X` with `Q` symmetric has, with the flow of a motion, a second motion for eight linear
/// equations: here nu = (eta^t Q eta) / (a . eta).
#[test]
fn a_quadric_through_the_camera_is_no_trap() {
    let motion = Motion::new([0.6, 0.2, 0.75], W);
    let scene = Scene::new(motion, 300, 0.6, 0.0, 7, |x, y, _| {
        let (x, y) = (0.6 * x, 0.6 * y);
        (0.5 * x * x - 0.3 * x * y + 0.8 * y * y + 0.4 * x + 1.0) / (0.2 * x - 0.3 * y + 1.1)
    });
    let found = run(&scene, &Noise::StandardDeviation(1e-6));
    assert!(found.motion.angle_to(&motion) < 1e-4, "{:?}", found.motion);
}
