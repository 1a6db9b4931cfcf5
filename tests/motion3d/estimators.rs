//! Estimates against the truth and against what their covariances promise.

use super::scenes::{Held, Scene, W, oblique, smooth};
use jacoflow::math::random::CounterRng;
use jacoflow::motion3d::*;
use jacoflow::parallel::Threads;
use nalgebra::Vector3;

fn options(method: Method) -> MotionOptions {
    MotionOptions { method, placement: Placement::Start, ..MotionOptions::default() }
}

fn angle(found: &MotionEstimate, scene: &Scene) -> f64 {
    found.motion.angle_to(&scene.motion).to_degrees()
}

const MOTIONS: [([f64; 3], [f64; 3]); 4] =
    [([1.0, 0.0, 0.0], [0.0; 3]), ([0.6, 0.2, 0.75], W), ([0.05, -0.03, 1.0], W), ([0.35, 0.25, 1.0], W)];

#[test]
fn exact_flow_gives_every_motion_both_signs() {
    for (u, w) in MOTIONS {
        for sign in [1.0, -1.0] {
            let motion = Motion::new(u.map(|value| sign * value), w);
            let scene = Scene::new(motion, 200, 0.6, 0.0, 3, |_, _, r| 0.5 + r);
            for method in [Method::MaximumLikelihood, Method::Efficient] {
                let found = estimate_motion(&scene.flow(), &Noise::StandardDeviation(1e-6), &options(method)).unwrap();
                assert!(angle(&found, &scene) < 1e-6, "{motion:?}: {}", angle(&found, &scene));
                assert_eq!(found.status, Status::Ok);
                let unknown = estimate_motion(&scene.flow(), &Noise::Unknown, &options(method)).unwrap();
                assert!(angle(&unknown, &scene) < 1e-6 && unknown.status == Status::Ok, "{:?}", unknown.status);
            }
        }
    }
}

#[test]
fn the_sphere_gives_the_motion_all_around() {
    let rng = CounterRng::new(5);
    let motion = oblique();
    let bearing = |k: u64| Vector3::new(rng.normal(3 * k), rng.normal(3 * k + 1), rng.normal(3 * k + 2)).normalize();
    let bearings: Vec<[f64; 3]> = (0..300).map(|k| bearing(k).into()).collect();
    let flow: Vec<[f64; 3]> = bearings
        .iter()
        .enumerate()
        .map(|(k, &b)| motion.sphere_flow(b, 0.5 + rng.stream(1).uniform(k as u64)))
        .collect();
    let flow = Flow::Sphere { bearings: &bearings, flow: &flow };
    for method in [Method::MaximumLikelihood, Method::Efficient] {
        let found = estimate_motion(&flow, &Noise::StandardDeviation(1e-6), &options(method)).unwrap();
        assert!(found.motion.angle_to(&motion) < 1e-8, "{}", found.motion.angle_to(&motion));
    }
}

#[test]
fn covariances_cover_where_depths_are_random() {
    let (mut square, mut held) = (0.0_f64, Held::default());
    for seed in 0..200 {
        let scene = Scene::oblique(500, 0.03, seed);
        let found = scene.run(&options(Method::MaximumLikelihood));
        square += angle(&found, &scene).powi(2);
        held.count(&found, &scene.motion);
    }
    let plain = (square / 200.0).sqrt();
    assert!((0.37..0.55).contains(&plain), "published: 0.46, got {plain}");
    assert!(held.honest(), "{held:?}");
}

#[test]
fn outliers_do_not_move_the_motion() {
    let rng = CounterRng::new(77);
    let mut scene = Scene::new(oblique(), 800, 0.6, 0.02, 4, |x, y, _| smooth(x, y));
    for (k, flow) in scene.flow.iter_mut().enumerate().filter(|(k, _)| k % 5 < 2) {
        *flow = [0, 1].map(|j| 4.0 * (2.0 * rng.uniform(2 * k as u64 + j) - 1.0));
    }
    for noise in [Noise::StandardDeviation(0.02), Noise::Unknown] {
        let options = MotionOptions { robust: true, ..options(Method::Auto) };
        let found = estimate_motion(&scene.flow(), &noise, &options).unwrap();
        assert!(angle(&found, &scene) < 2.0, "{}", angle(&found, &scene));
        assert!((found.noise_std / 0.02 - 1.0).abs() < 0.15, "{}", found.noise_std);
        let right = found.inliers.iter().enumerate().filter(|(k, inlier)| **inlier == (k % 5 >= 2)).count();
        assert!(right > 750, "{right}");
    }
}

#[test]
fn nothing_depends_on_the_number_of_threads() {
    let scene = Scene::oblique(9000, 0.1, 6);
    for robust in [false, true] {
        let run = |threads: usize| {
            let threads = Threads::new(Some(threads)).unwrap();
            let options = MotionOptions { robust, threads, ..options(Method::Efficient) };
            let found = estimate_motion(&scene.flow(), &Noise::Unknown, &options).unwrap();
            let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
            (bits(found.covariance.as_flattened()), bits(&found.inverse_depth_smooth), bits(&found.residuals))
        };
        assert!(run(1) == run(3), "robust: {robust}");
    }
}

#[test]
fn midpoints_make_displacements_exact_to_second_order() {
    let motion = Motion::new([0.6, 0.2, 0.75], [0.02, -0.03, 0.02]);
    let rng = CounterRng::new(9);
    let turn = motion.rotation_matrix();
    let (t, scale) = (motion.displacement(), 0.05);
    let mut points = Vec::new();
    let mut flow = Vec::new();
    for k in 0..500 {
        let p = [rng.uniform(3 * k) - 0.5, rng.uniform(3 * k + 1) - 0.5];
        let z = 1.0 / (0.5 + rng.uniform(3 * k + 2));
        let x = [p[0] * z, p[1] * z, z];
        let moved: [f64; 3] = std::array::from_fn(|i| (0..3).map(|j| turn[i][j] * x[j]).sum::<f64>() + scale * t[i]);
        points.push(p);
        flow.push([moved[0] / moved[2] - p[0], moved[1] / moved[2] - p[1]]);
    }
    let error = |placement| {
        let options = MotionOptions { placement, ..options(Method::MaximumLikelihood) };
        let flow = Flow::Plane { points: &points, flow: &flow, camera: None };
        estimate_motion(&flow, &Noise::Unknown, &options).unwrap().motion.angle_to(&motion)
    };
    let (start, middle) = (error(Placement::Start), error(Placement::Midpoint));
    assert!(middle < 0.05 * start && middle.to_degrees() < 0.02, "{start} {middle}");
}

/// In a narrow field only a rotation prior separates it from a lateral translation.
#[test]
fn a_known_rotation_is_heeded() {
    let motion = oblique();
    let scene = Scene::new(motion, 200, 0.1, 0.01, 5, |_, _, r| 0.5 + r);
    let covariance = std::array::from_fn(|i| std::array::from_fn(|j| if i == j { 1e-8 } else { 0.0 }));
    let prior = Some(RotationPrior { rotation: motion.rotation, covariance });
    for robust in [false, true] {
        for method in [Method::MaximumLikelihood, Method::Efficient] {
            let run = |rotation_prior| {
                let options = MotionOptions { robust, rotation_prior, ..options(method) };
                estimate_motion(&scene.flow(), &Noise::StandardDeviation(0.01), &options).unwrap()
            };
            let (without, with) = (run(None), run(prior));
            assert!(
                with.direction_std < 0.3 * without.direction_std,
                "{} {}",
                with.direction_std,
                without.direction_std
            );
            assert!(angle(&with, &scene) < 4.0 * with.direction_std, "{}", angle(&with, &scene));
            assert!(with.rotation_std.iter().all(|deviation| *deviation < 1.01e-4));
        }
    }
}

#[test]
fn weights_may_have_their_depths_from_elsewhere() {
    let scene = Scene::oblique(500, 0.2, 12);
    let with = MotionOptions { weight_depths: Some(scene.inverse_depth.clone()), ..options(Method::Efficient) };
    let found = estimate_motion(&scene.flow(), &Noise::StandardDeviation(0.2), &with).unwrap();
    assert!(found.efficient);
    for (got, want) in found.inverse_depth_smooth.iter().zip(&scene.inverse_depth) {
        assert_eq!(got, want);
    }
    let short = MotionOptions { weight_depths: Some(vec![1.0]), ..options(Method::Efficient) };
    let error = estimate_motion(&scene.flow(), &Noise::StandardDeviation(0.2), &short).unwrap_err().to_string();
    assert!(error.starts_with("weight_inv_depth: "), "{error}");
}

/// For any given weights, the covariance is that of the result.
#[test]
fn weights_of_any_unit_and_quality_leave_the_covariance_honest() {
    let noise = CounterRng::new(55);
    let run = |scene: &Scene, depths: Vec<f64>| {
        let with = MotionOptions { weight_depths: Some(depths), ..options(Method::Efficient) };
        estimate_motion(&scene.flow(), &Noise::StandardDeviation(scene.noise_std), &with).unwrap()
    };
    let scene = Scene::oblique(300, 0.03, 5);
    let want = run(&scene, scene.inverse_depth.clone());
    for factor in [0.01, 0.2, 3.0, 10.0, 100.0] {
        let found = run(&scene, scene.inverse_depth.iter().map(|nu| factor * nu).collect());
        assert!(found.efficient, "{factor}");
        assert!((found.direction_std / want.direction_std - 1.0).abs() < 1e-3, "{factor}: {}", found.direction_std);
        assert!(found.motion.angle_to(&want.motion) < 1e-6, "{factor}");
    }
    let mut held = Held::default();
    for seed in 0..300 {
        let scene = Scene::oblique(300, 0.03, seed);
        let depths = scene.inverse_depth.iter().enumerate();
        let noisy = depths.map(|(k, nu)| nu + noise.stream(seed).normal(k as u64)).collect();
        held.count(&run(&scene, noisy), &scene.motion);
    }
    assert!(held.honest(), "{held:?}");
}

/// A depth that is not known for the weights leaves its point out and no other.
#[test]
fn a_weight_that_is_not_finite_leaves_its_point_out() {
    let scene = Scene::oblique(200, 0.05, 5);
    let mut depths = scene.inverse_depth.clone();
    depths[3] = f64::NAN;
    let with = |weight_depths| MotionOptions { weight_depths: Some(weight_depths), ..options(Method::Efficient) };
    let found = estimate_motion(&scene.flow(), &Noise::StandardDeviation(0.05), &with(depths)).unwrap();
    assert!(found.efficient && !found.fell_back && !found.inliers[3] && found.inverse_depth[3].is_nan());
    let mut without = scene.clone();
    without.points.remove(3);
    without.flow.remove(3);
    without.inverse_depth.remove(3);
    let want = estimate_motion(&without.flow(), &Noise::StandardDeviation(0.05), &with(without.inverse_depth.clone()))
        .unwrap();
    assert_eq!(found.motion, want.motion);
}
