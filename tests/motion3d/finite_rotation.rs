//! Displacements over a whole frame of fast turns.

use super::scenes::{ELLIPSOID, Scene, mahalanobis, oblique};
use jacoflow::math::random::CounterRng;
use jacoflow::motion3d::*;
use nalgebra::{Matrix3, Vector3};

/// Directions of rotations, each of length 1.
const AXES: [[f64; 3]; 4] = [[0.6, -0.64, 0.48], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-0.8, 0.0, 0.6]];

/// A motion that turns by `turn` rad about one of the axes.
fn rotating(axis: usize, turn: f64) -> Motion {
    Motion::new([0.6, 0.2, 0.75], AXES[axis].map(|value| turn * value))
}

/// Two exact views: points of the first on the plane at distance 1, their displacement, and their inverse
/// depths half way in time.
struct Views {
    points: Vec<[f64; 2]>,
    flow: Vec<[f64; 2]>,
    half_way: Vec<f64>,
}

/// Of random points all over the view.
fn views(motion: &Motion, n: usize, seed: u64, nu: impl Fn([f64; 2], f64) -> f64) -> Views {
    let rng = CounterRng::new(seed);
    views_at(motion, n, seed, |k| [0, 1].map(|i| 1.2 * rng.uniform(3 * k + i) - 0.6), nu)
}

/// `at`: the place of a point in the first view; `nu`: the inverse depth there of a place, and of a random
/// number.
fn views_at(
    motion: &Motion,
    n: usize,
    seed: u64,
    at: impl Fn(u64) -> [f64; 2],
    nu: impl Fn([f64; 2], f64) -> f64,
) -> Views {
    let rng = CounterRng::new(seed);
    let half = Motion { translation: motion.translation, rotation: motion.rotation.map(|w| 0.5 * w) };
    let matrix = |motion: &Motion| Matrix3::from_fn(|i, j| motion.rotation_matrix()[i][j]);
    let (whole, half_turn) = (matrix(motion), matrix(&half));
    let mut out = Views { points: Vec::new(), flow: Vec::new(), half_way: Vec::new() };
    for k in 0..n as u64 {
        let [x, y] = at(k);
        let (eta, nu) = (Vector3::new(x, y, 1.0), nu([x, y], rng.uniform(3 * k + 2)));
        let after = whole * eta + nu * Vector3::from(motion.displacement());
        let middle = half_turn * eta + 0.5 * nu * Vector3::from(half.displacement());
        out.points.push([x, y]);
        out.flow.push([after.x / after.z - x, after.y / after.z - y]);
        out.half_way.push(nu / middle.z);
    }
    out
}

impl Views {
    fn run(&self, noise: &Noise<'_>, options: &MotionOptions) -> MotionEstimate {
        let flow = Flow::Plane { points: &self.points, flow: &self.flow, camera: None };
        estimate_motion(&flow, noise, options).unwrap()
    }

    fn noisy(mut self, noise_std: f64, seed: u64) -> Self {
        let rng = CounterRng::new(seed);
        for (k, flow) in self.flow.iter_mut().enumerate() {
            *flow = std::array::from_fn(|i| flow[i] + noise_std * rng.normal((2 * k + i) as u64));
        }
        self
    }

    fn with_outliers(mut self, share: f64, seed: u64) -> Self {
        let rng = CounterRng::new(seed);
        for (k, flow) in self.flow.iter_mut().enumerate() {
            if rng.uniform(3 * k as u64) < share {
                *flow = [1, 2].map(|i| 0.3 * (2.0 * rng.uniform(3 * k as u64 + i) - 1.0));
            }
        }
        self
    }
}

fn off(found: &Motion, truth: &Motion) -> f64 {
    found.angle_to(truth).max((Vector3::from(found.rotation) - Vector3::from(truth.rotation)).norm())
}

#[test]
fn two_exact_views_give_the_exact_motion_and_depths() {
    for (axis, turn, scale) in [(0, 0.3, 0.2), (1, 0.3, 0.02), (2, 0.2, 0.1), (3, 0.1, 0.2), (0, 0.02, 0.02)] {
        let truth = rotating(axis, turn);
        let seen = views(&truth, 200, 3, |_, r| scale * (0.5 + r));
        for method in [Method::MaximumLikelihood, Method::Efficient] {
            for (noise, robust) in [
                (Noise::Unknown, false),
                (Noise::StandardDeviation(1e-6), false),
                (Noise::Unknown, true),
                (Noise::StandardDeviation(1e-6), true),
            ] {
                let found = seen.run(&noise, &MotionOptions { method, robust, ..MotionOptions::default() });
                let error = off(&found.motion, &truth);
                assert!(error < 1e-8, "{axis} {turn} {scale} {method:?} {noise:?} {robust}: {error}");
                let depths = found.inverse_depth.iter().zip(&seen.half_way);
                let worst = depths.map(|(got, want)| (got / want - 1.0).abs()).fold(0.0, f64::max);
                assert!(worst < 1e-5, "{axis} {turn} {scale}: {worst}");
            }
        }
    }
}

/// Where the third order does not matter, the result is that of instantaneous flow half way.
#[test]
fn slow_displacements_are_instantaneous_flow_half_way() {
    let truth = rotating(0, 0.02);
    let seen = views(&truth, 300, 3, |_, r| 0.02 * (0.5 + r)).noisy(6e-4, 5);
    let options = MotionOptions { method: Method::MaximumLikelihood, ..MotionOptions::default() };
    let found = seen.run(&Noise::StandardDeviation(6e-4), &options);
    let half_way = Views {
        points: seen.points.iter().zip(&seen.flow).map(|(p, f)| [p[0] + 0.5 * f[0], p[1] + 0.5 * f[1]]).collect(),
        flow: seen.flow.clone(),
        half_way: Vec::new(),
    };
    let options = MotionOptions { placement: Placement::Start, ..options };
    let instantaneous = half_way.run(&Noise::StandardDeviation(6e-4), &options).motion;
    assert!(found.motion.angle_to(&instantaneous).to_degrees() < 0.01 * found.direction_std);
}

/// Points on one line of the picture determine the motion; a turn of a radian past near points fits them
/// nearly as well, with most of the noise hidden in depths that change by as much as they are.
#[test]
fn points_on_a_line_are_given_no_invented_turn() {
    let turns = CounterRng::new(77);
    for start in [false, true] {
        let mut ok = 0;
        for seed in 0..40 {
            let axis = [0, 1, 2].map(|i| turns.normal(3 * seed + i));
            let turn = Vector3::from(axis).normalize() * 0.15;
            let truth = Motion::new([0.6, 0.2, 0.75], turn.into());
            let line = |k: u64| [1.2 * CounterRng::new(400 + seed).uniform(k) - 0.6, 0.2];
            let seen = views_at(&truth, 300, seed, line, |_, r| 0.1 * (0.5 + r)).noisy(5e-4, 100 + seed);
            let options = MotionOptions { initial: start.then_some(truth), ..MotionOptions::default() };
            let found = seen.run(&Noise::StandardDeviation(5e-4), &options);
            if found.status == Status::Ok {
                ok += 1;
                let error = found.motion.angle_to(&truth).to_degrees();
                assert!(
                    error < 12.0
                        && (Vector3::from(found.motion.rotation) - Vector3::from(truth.rotation)).norm() < 0.03,
                    "{seed}: {error}"
                );
            }
        }
        assert!(ok >= 34, "{start}: {ok}");
    }
}

/// Points on a curve, whose places half way hold the flow's noise across it: depths predicted from these
/// would share it with the residuals, and pull the estimate.
#[test]
fn smoothed_weights_are_as_good_on_a_curve() {
    let truth = Motion::new([0.35, 0.25, 1.0], [0.0; 3]);
    let (mut held, mut smoothed, mut likelihood) = (0, 0.0, 0.0);
    for seed in 0..60 {
        let angle = CounterRng::new(300 + seed);
        let circle = |k: u64| {
            let (sin, cos) = (std::f64::consts::TAU * angle.uniform(k)).sin_cos();
            [0.5 * cos, 0.5 * sin]
        };
        let seen = views_at(&truth, 196, seed, circle, |_, r| 0.1 * (0.5 + r)).noisy(3e-3, 100 + seed);
        let found = seen.run(&Noise::StandardDeviation(3e-3), &MotionOptions::default());
        held += u32::from(mahalanobis(&found, &truth) < ELLIPSOID);
        smoothed += found.motion.angle_to(&truth).powi(2);
        likelihood += found.likelihood.motion.angle_to(&truth).powi(2);
    }
    assert!(held >= 53, "{held} of 60");
    assert!(smoothed < 1.05 * likelihood, "{smoothed} {likelihood}");
}

#[test]
fn fast_turns_without_translation_are_reported() {
    for turn in [0.15, 0.3] {
        for (robust, share) in [(false, 0.0), (true, 0.3)] {
            for seed in 0..6 {
                let truth = rotating(seed as usize % 4, turn);
                let seen =
                    views(&truth, 300, seed, |_, _| 0.0).noisy(1e-4, 100 + seed).with_outliers(share, 200 + seed);
                for noise in [Noise::StandardDeviation(1e-4), Noise::Unknown] {
                    let found = seen.run(&noise, &MotionOptions { robust, ..MotionOptions::default() });
                    assert_eq!(found.status, Status::RotationOnly, "{turn} {robust} {seed} {noise:?}");
                    let error = (Vector3::from(found.motion.rotation) - Vector3::from(truth.rotation)).norm();
                    assert!(error < 5.0 * Vector3::from(found.rotation_std).norm(), "{turn} {robust} {seed}: {error}");
                }
            }
        }
    }
}

/// A plane's two motions satisfy its displacements exactly.
#[test]
fn a_plane_has_two_exact_motions() {
    for (turn, scale) in [(0.02, 0.02), (0.25, 0.02), (0.25, 0.15)] {
        let truth = rotating(0, turn);
        let seen = views(&truth, 300, 3, |[x, y], _| scale * (0.9 + 0.3 * x - 0.2 * y));
        let found = seen.run(&Noise::StandardDeviation(1e-7), &MotionOptions::default());
        assert_eq!(found.status, Status::Ambiguous);
        let both = [found.motion, found.alternatives[0].motion];
        assert!(both.iter().any(|motion| off(motion, &truth) < 1e-8), "{turn} {scale}");
        assert!(both[0].angle_to(&both[1]) > 0.3);
        for motion in both {
            let essential = Matrix3::from_fn(|i, j| motion.essential_matrix()[i][j]);
            for (p, f) in seen.points.iter().zip(&seen.flow) {
                let (first, second) = (Vector3::new(p[0], p[1], 1.0), Vector3::new(p[0] + f[0], p[1] + f[1], 1.0));
                assert!((second.transpose() * essential * first)[0].abs() < 1e-11, "{turn} {scale}");
            }
        }
    }
}

/// Flow and Jacobian of patches in two exact views.
#[test]
fn exact_patches_give_the_exact_motion() {
    for (turn, scale) in [(0.02, 0.02), (0.3, 0.02), (0.3, 0.2)] {
        let truth = rotating(0, turn);
        let rng = CounterRng::new(7);
        let (mut points, mut motion) = (Vec::new(), Vec::new());
        for k in 0..12 {
            let at: [f64; 2] = std::array::from_fn(|i| rng.uniform(5 * k + i as u64) - 0.5);
            let surface: [f64; 3] =
                std::array::from_fn(|i| scale * (rng.uniform(5 * k + 2 + i as u64) + if i == 0 { 0.5 } else { -0.5 }));
            let flow = |x: f64, y: f64| {
                let nu = surface[0] + surface[1] * (x - at[0]) + surface[2] * (y - at[1]);
                let turn = Matrix3::from_fn(|i, j| truth.rotation_matrix()[i][j]);
                let after = turn * Vector3::new(x, y, 1.0) + nu * Vector3::from(truth.displacement());
                [after.x / after.z - x, after.y / after.z - y]
            };
            let h = 1e-5;
            let slope = |dx: f64, dy: f64, i: usize| {
                (flow(at[0] + dx, at[1] + dy)[i] - flow(at[0] - dx, at[1] - dy)[i]) / (2.0 * h)
            };
            let [u, v] = flow(at[0], at[1]);
            points.push(at);
            motion.push([u, v, slope(h, 0.0, 0), slope(h, 0.0, 1), slope(0.0, h, 0), slope(0.0, h, 1)]);
        }
        let covariances: Vec<f64> =
            (0..12).flat_map(|_| nalgebra::Matrix6::<f64>::identity().as_slice().to_vec()).collect();
        let covariances: Vec<f64> = covariances.into_iter().map(|value| 1e-16 * value).collect();
        let patches = AffinePatches { points: &points, motion: &motion, covariances: &covariances, camera: None };
        let found = estimate_patch_motion(&patches, &MotionOptions::default()).unwrap();
        assert!(off(&found.motion, &truth) < 1e-7, "{turn} {scale}: {}", off(&found.motion, &truth));
    }
}

/// For any flow, as displacements in pixels of points on the plane at distance 1 are: rotations that
/// lead all points behind the camera are no reason to stop.
#[test]
fn flow_that_no_rotation_can_be_taken_out_of_is_no_reason_to_stop() {
    for seed in 0..60 {
        let scale = [1.0, 100.0, 1e5][seed as usize % 3];
        let scene = Scene::new(oblique(), 12 + 20 * (seed as usize % 4), 0.5, scale, seed, |_, _, r| 0.5 + r);
        for robust in [false, true] {
            let options = MotionOptions { robust, ..MotionOptions::default() };
            let found = estimate_motion(&scene.flow(), &Noise::Unknown, &options).unwrap();
            assert_ne!(found.status, Status::TooFewPoints, "{seed}");
        }
    }
}
