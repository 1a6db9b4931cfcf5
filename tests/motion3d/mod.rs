//! 3-D motion through the public interface: from frames over a field to motion and depths, six numbers a
//! patch, promises.

mod confidence;
mod correlated_noise;
mod degenerate;
mod dense_points;
mod estimators;
mod field_patches;
mod field_points;
mod finite_rotation;
mod lateral;
mod maximum_likelihood;
mod motion_model;
mod moving_objects;
mod narrow_fields;
mod noisy_depths;
mod outlier_posterior;
mod outliers;
mod patches;
mod published;
mod rotation_prior;
mod scenes;
mod statuses;
mod time_to_contact;
mod unknown_directions;

// The scenes name them by their place in the crate, whose unit tests share them.
use jacoflow::types::{FieldLayout, FlowField, Interval, MOTION_NAMES, SamplingGrid, Units};
use jacoflow::{math, motion3d};
use math::Real;
use math::random::CounterRng;
use motion3d::{
    AffinePatches, Flow, Intrinsics, Method, Motion, MotionOptions, Noise, Placement, Status, estimate_motion,
    estimate_patch_motion, focus_of_expansion, motion_bound, patch_motion_bound,
};

const W: [f64; 3] = [0.02, -0.03, 0.01];

fn oblique() -> Motion {
    Motion::new([0.6, 0.2, 0.75], W)
}

/// A field of valid sites of a grid, without flow, whose errors go together over `length` px.
fn empty_field<T: Real>(frame_size: (usize, usize), stride: usize, length: f64) -> FlowField<T> {
    let layout = FieldLayout {
        frame_size,
        sites: SamplingGrid::Grid { region: None, stride },
        model: "affine".into(),
        parameters: MOTION_NAMES.map(String::from).to_vec(),
        units: Units::default(),
        interval: Interval::Instant,
        frame_index: 0,
        correlation_length: length,
    };
    let mut field = FlowField::empty(layout, true).unwrap();
    field.status.fill(jacoflow::types::Status::Ok);
    field
}

/// Pixels of a 640 x 480 picture with their exact displacement over one frame, and inverse depths.
fn two_views(camera: &Intrinsics, motion: &Motion, n: u64, scale: f64) -> (Vec<[f64; 2]>, Vec<[f64; 2]>, Vec<f64>) {
    let rng = CounterRng::new(11);
    let (turn, shift) = (motion.rotation_matrix(), motion.displacement());
    let (mut points, mut flow, mut depths) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..n {
        let pixel = [640.0 * rng.uniform(3 * k), 480.0 * rng.uniform(3 * k + 1)];
        let nu = scale * (0.5 + rng.uniform(3 * k + 2));
        let [x, y] = camera.to_plane(pixel);
        let eta = [x, y, 1.0];
        let after: [f64; 3] = std::array::from_fn(|i| (0..3).map(|j| turn[i][j] * eta[j]).sum::<f64>() + nu * shift[i]);
        let there = camera.to_pixel([after[0] / after[2], after[1] / after[2]]);
        points.push(pixel);
        flow.push([there[0] - pixel[0], there[1] - pixel[1]]);
        depths.push(nu);
    }
    (points, flow, depths)
}

#[test]
fn two_views_in_pixels_give_motion_depths_and_focus() {
    let camera = Intrinsics::new([[500.0, 1.0, 320.0], [0.0, 480.0, 240.0], [0.0, 0.0, 1.0]]).unwrap();
    let (points, flow, depths) = two_views(&camera, &oblique(), 800, 0.02);
    let rng = CounterRng::new(5);
    let noisy: Vec<[f64; 2]> = flow
        .iter()
        .enumerate()
        .map(|(k, f)| [0, 1].map(|j| f[j] + 0.1 * rng.normal(2 * k as u64 + j as u64)))
        .collect();
    let flow = Flow::Plane { points: &points, flow: &noisy, camera: Some(&camera) };
    let found = estimate_motion(&flow, &Noise::StandardDeviation(0.1), &MotionOptions::default()).unwrap();
    assert_eq!((found.status, found.efficient), (Status::Ok, true));
    let error = found.motion.angle_to(&oblique()).to_degrees();
    assert!(error < 3.0 * found.direction_std && found.direction_std < 1.0, "{error} {}", found.direction_std);
    let ratio: Vec<f64> = found.inverse_depth_smooth.iter().zip(&depths).map(|(got, want)| got / want).collect();
    let mean = ratio.iter().sum::<f64>() / ratio.len() as f64;
    assert!((mean - 1.0).abs() < 0.05, "inverse depths are in units of |u| per frame: {mean}");
    let (focus, spread) = focus_of_expansion(&found.motion, &found.tangent, &found.covariance, Some(&camera)).unwrap();
    let truth = camera.to_pixel([0.6 / 0.75, 0.2 / 0.75]);
    for i in 0..2 {
        assert!((focus[i] - truth[i]).abs() < 4.0 * spread[i][i].sqrt(), "{focus:?} {truth:?}");
    }
}

#[test]
fn the_predicted_deviation_is_met_where_the_design_says_so() {
    let rng = CounterRng::new(21);
    let points: Vec<[f64; 2]> = (0..500).map(|k| [0, 1].map(|j| 1.2 * rng.uniform(2 * k + j) - 0.6)).collect();
    let depths: Vec<f64> = (0..500).map(|k| 0.5 + rng.stream(1).uniform(k)).collect();
    let still = vec![[0.0; 2]; 500];
    let design = Flow::Plane { points: &points, flow: &still, camera: None };
    let bound = motion_bound(&design, &Noise::StandardDeviation(0.05), &oblique(), &depths).unwrap();
    let mut square = 0.0;
    let trials = 200;
    for trial in 0..trials {
        let noise = rng.stream(100 + trial);
        let flow: Vec<[f64; 2]> = points
            .iter()
            .enumerate()
            .map(|(k, &p)| {
                let exact = oblique().plane_flow(p, depths[k]);
                [0, 1].map(|j| exact[j] + 0.05 * noise.normal(2 * k as u64 + j as u64))
            })
            .collect();
        let options = MotionOptions {
            method: Method::MaximumLikelihood,
            placement: Placement::Start,
            initial: Some(oblique()),
            ..MotionOptions::default()
        };
        let flow = Flow::Plane { points: &points, flow: &flow, camera: None };
        let found = estimate_motion(&flow, &Noise::StandardDeviation(0.05), &options).unwrap();
        square += found.motion.angle_to(&oblique()).to_degrees().powi(2);
    }
    let rms = (square / f64::from(trials as u32)).sqrt();
    assert!((rms / bound.direction_std[1] - 1.0).abs() < 0.2, "{rms} {:?}", bound.direction_std);
}

/// Patches with affine flow in pixels and what it was made from.
struct Patches {
    points: Vec<[f64; 2]>,
    motion: Vec<[f64; 6]>,
    covariances: Vec<f64>,
    surfaces: Vec<[f64; 3]>,
}

fn patches(camera: &Intrinsics, truth: &Motion, n: u64, noise_std: f64) -> Patches {
    let rng = CounterRng::new(31);
    let deviations = [noise_std, noise_std, noise_std / 35.0, noise_std / 35.0, noise_std / 35.0, noise_std / 35.0];
    let mut out = Patches { points: vec![], motion: vec![], covariances: vec![], surfaces: vec![] };
    for k in 0..n {
        let at = [0, 1].map(|j| 0.6 * rng.uniform(2 * k + j) - 0.3);
        let nu = 0.006 * (0.5 + rng.stream(1).uniform(k));
        let surface = [nu, 0.5 * nu * rng.stream(2).normal(2 * k), 0.5 * nu * rng.stream(2).normal(2 * k + 1)];
        let [u, v, u_x, v_x, u_y, v_y] = truth.affine_flow(at, surface);
        let noise = |i: u64| deviations[i as usize] * rng.stream(3).normal(6 * k + i);
        // With equal focal lengths slopes are the same in pixels.
        let m = [500.0 * u, 500.0 * v, u_x, v_x, u_y, v_y];
        out.points.push(camera.to_pixel(at));
        out.motion.push(std::array::from_fn(|i| m[i] + noise(i as u64)));
        out.surfaces.push(surface);
        for i in 0..6 {
            out.covariances.extend((0..6).map(|j| if i == j { deviations[i].powi(2) } else { 0.0 }));
        }
    }
    out
}

#[test]
fn six_numbers_a_patch_reach_their_bound() {
    let camera = Intrinsics::pinhole((500.0, 500.0), (320.0, 240.0)).unwrap();
    let truth = Motion::new([0.6, 0.2, 0.75], [0.0002, -0.0003, 0.0001]);
    let made = patches(&camera, &truth, 60, 0.02);
    let patches = AffinePatches {
        points: &made.points,
        motion: &made.motion,
        covariances: &made.covariances,
        camera: Some(&camera),
    };
    let options = MotionOptions { placement: Placement::Start, ..MotionOptions::default() };
    let found = estimate_patch_motion(&patches, &options).unwrap();
    let bound = patch_motion_bound(&patches, &truth, &made.surfaces).unwrap();
    let error = found.motion.angle_to(&truth).to_degrees();
    assert!(error < 4.0 * bound.direction_std[0], "{error} {:?}", bound.direction_std);
    assert!((found.direction_std / bound.direction_std[0] - 1.0).abs() < 0.3, "{}", found.direction_std);
    assert_eq!((found.status, found.efficient, found.surfaces.len()), (Status::Ok, true, 60));
    assert!(bound.direction_std[0] <= bound.direction_std[2] && bound.direction_std[2] < bound.direction_std[1]);
    let short = AffinePatches { covariances: &made.covariances[1..], ..patches };
    assert!(estimate_patch_motion(&short, &options).unwrap_err().to_string().starts_with("cov: "));
    let robust = MotionOptions { robust: true, ..options };
    assert!(estimate_patch_motion(&patches, &robust).unwrap_err().to_string().starts_with("robust: "));
}

#[test]
fn patches_that_only_turn_or_lie_in_one_plane_are_reported() {
    let camera = Intrinsics::pinhole((500.0, 500.0), (320.0, 240.0)).unwrap();
    let turning = Motion { translation: [0.0; 3], rotation: [0.002, -0.003, 0.001] };
    let options = MotionOptions { placement: Placement::Start, ..MotionOptions::default() };
    let run = |made: &Patches| {
        let patches = AffinePatches {
            points: &made.points,
            motion: &made.motion,
            covariances: &made.covariances,
            camera: Some(&camera),
        };
        estimate_patch_motion(&patches, &options).unwrap()
    };
    let found = run(&patches(&camera, &turning, 20, 0.02));
    assert_eq!(found.status, Status::RotationOnly);
    for i in 0..3 {
        assert!((found.motion.rotation[i] - turning.rotation[i]).abs() < 4.0 * found.rotation_std[i]);
    }
    let truth = Motion::new([0.6, 0.2, 0.75], [0.0002, -0.0003, 0.0001]);
    let mut flat = patches(&camera, &truth, 20, 0.02);
    let noise = CounterRng::new(3);
    for k in 0..20 {
        let [x, y] = camera.to_plane(flat.points[k]);
        let surface = [0.006 * (0.9 + 0.3 * x - 0.2 * y), 0.0018, -0.0012];
        let [u, v, u_x, v_x, u_y, v_y] = truth.affine_flow([x, y], surface);
        let exact = [500.0 * u, 500.0 * v, u_x, v_x, u_y, v_y];
        flat.motion[k] = std::array::from_fn(|i| {
            exact[i] + flat.covariances[36 * k + 7 * i].sqrt() * noise.normal(6 * k as u64 + i as u64)
        });
    }
    let found = run(&flat);
    assert_eq!(found.status, Status::Ambiguous);
    let nearest = std::iter::once(found.motion)
        .chain(found.alternatives.iter().map(|other| other.motion))
        .map(|motion| motion.angle_to(&truth).to_degrees())
        .fold(f64::INFINITY, f64::min);
    assert!(nearest < 4.0 * found.direction_std && found.direction_std < 5.0, "{nearest}");
}
