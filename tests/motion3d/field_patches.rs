//! Windows of fields whose flow is known.

use super::empty_field;
use super::math::random::CounterRng;
use super::motion3d::{
    Intrinsics, Motion, MotionEstimate, MotionOptions, Placement, Status as MotionStatus, estimate_patch_motion,
    field_patches,
};
use jacoflow::types::{FlowField, Rect, Status};
use nalgebra::{SMatrix, SVector};

const FOCAL: f64 = 500.0;

/// Area over which errors are one, in squared correlation lengths.
const AREA: f64 = std::f64::consts::PI * (4.0 * 0.4 + 2.0 * 0.6 * 3.75 * 3.75);

/// Standard deviations of the flow, px, and of its slopes, 1/frame, at each pixel.
const NOISE: [f64; 6] = [0.06, 0.06, 0.006, 0.006, 0.006, 0.006];

fn camera() -> Intrinsics {
    Intrinsics::pinhole((FOCAL, FOCAL), (160.0, 120.0)).unwrap()
}

/// A field of 320 x 240 px whose six numbers at each pixel are given, with the standard deviations `NOISE`.
fn field(stride: usize, length: f64, six: impl Fn(f64, f64) -> [f64; 6]) -> FlowField<f64> {
    let mut field = empty_field::<f64>((320, 240), stride, length);
    let n = field.len();
    let covariance = field.covariance.as_mut().unwrap();
    covariance.fill(0.0);
    // Row i of the upper triangle begins with the variance.
    for (i, plane) in [0, 6, 11, 15, 18, 20].into_iter().enumerate() {
        covariance[plane * n..(plane + 1) * n].fill(NOISE[i] * NOISE[i]);
    }
    for site in 0..n {
        let (x, y) = field.layout.sites.pixel(site % field.width, site / field.width);
        for (i, value) in six(x as f64, y as f64).into_iter().enumerate() {
            field.motion[i * n + site] = value;
        }
    }
    field
}

fn affine(x: f64, y: f64) -> [f64; 6] {
    [1.0 + 0.01 * x - 0.02 * y, -2.0 + 0.03 * x + 0.005 * y, 0.01, 0.03, -0.02, 0.005]
}

#[test]
fn an_affine_flow_is_reported_at_the_middles() {
    let found = field_patches(&field(1, 0.0, affine), 60, None).unwrap();
    assert_eq!(found.points.len(), 20);
    assert_eq!((found.points[0], found.points[19]), ([39.5, 29.5], [279.5, 209.5]));
    for (at, six) in found.points.iter().zip(&found.motion) {
        for (got, want) in six.iter().zip(affine(at[0], at[1])) {
            assert!((got - want).abs() < 1e-10, "{got} {want}");
        }
    }
    // A slope has its own information and that of the flow around the middle; the flow is separated from a
    // bend, which the slopes determine, too. With the means of dx^2 and of dx^4.
    let (flow, slope) = (NOISE[0] * NOISE[0], NOISE[2] * NOISE[2]);
    let (second, fourth) = ((3600.0 - 1.0) / 12.0, (3.0 * 3600.0 * 3600.0 - 10.0 * 3600.0 + 7.0) / 240.0);
    let bend = 0.25 * (fourth + second * second) / flow + second / slope;
    let level = 1.0 / flow - 2.0 * (0.5 * second / flow).powi(2) / bend;
    let want = [1.0 / (3600.0 * level), 1.0 / (3600.0 * (1.0 / slope + second / flow))];
    assert!(want[0] > 1.2 * flow / 3600.0);
    for (k, want) in [(0, want[0]), (7, want[0]), (14, want[1]), (35, want[1])] {
        assert!((found.covariances[k] / want - 1.0).abs() < 1e-9, "{k}: {} {want}", found.covariances[k]);
    }
    // Every other pixel, whose errors go together over 3 px: 58 * 9 / 4 of them are one.
    let sparse = field_patches(&field(2, 3.0, affine), 60, None).unwrap();
    let sharing = AREA * 9.0 / 4.0;
    for k in [0, 14] {
        let larger = sparse.covariances[k] / found.covariances[k] / (4.0 * sharing);
        assert!((larger - 1.0).abs() < 0.02, "{k}: {larger}");
    }
}

#[test]
fn a_bend_does_not_shift_the_middle() {
    let bent = |x: f64, y: f64| {
        let (x, y) = (x - 39.5, y - 29.5);
        [1.0 + 1e-4 * x * x - 2e-4 * x * y, 3e-4 * y * y, 2e-4 * x - 2e-4 * y, 0.0, -2e-4 * x, 6e-4 * y]
    };
    let found = field_patches(&field(1, 0.0, bent), 60, None).unwrap();
    for (got, want) in found.motion[0].iter().zip([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]) {
        assert!((got - want).abs() < 1e-10, "{got} {want}");
    }
}

#[test]
fn only_what_is_seen_is_reported() {
    let mut field = field(1, 0.0, affine);
    let region = Some(Rect { x: 100, y: 60, width: 130, height: 70 });
    let inside = field_patches(&field, 60, region).unwrap();
    assert_eq!(inside.points, [[134.5, 94.5], [194.5, 94.5]]);
    for y in 65..125 {
        for x in 105..140 {
            field.status[320 * y + x] = Status::Border;
        }
    }
    // Not that of which 25 of 60 columns are left.
    let half = field_patches(&field, 60, region).unwrap();
    assert_eq!(half.points, [[194.5, 94.5]]);
    assert_eq!(half.covariances, inside.covariances[36..]);
    assert!(field_patches(&field, 400, None).unwrap().points.is_empty());
    assert!(field_patches(&field, 7, None).unwrap_err().to_string().starts_with("patches: "));
    let plain = FlowField { covariance: None, ..field.clone() };
    assert!(field_patches(&plain, 60, None).unwrap_err().to_string().starts_with("field: "));
    field.layout.parameters[2] = "other".into();
    assert!(field_patches(&field, 60, None).unwrap_err().to_string().starts_with("field: expected flow with its Jac"));
}

#[test]
fn a_window_over_an_edge_is_reported_less_surely() {
    let step = |x: f64, _: f64| if x < 30.0 { [3.0, 0.0, 0.0, 0.0, 0.0, 0.0] } else { [2.0, 0.0, 0.0, 0.0, 0.0, 0.0] };
    let found = field_patches(&field(1, 0.0, step), 60, None).unwrap();
    let variance = |k: usize| found.covariances[36 * k];
    // A third of the window moves by another pixel, 16 standard deviations of its noise.
    let off = (found.motion[0][0] - 3.0).abs();
    assert!(variance(0) > 3.0 * variance(1), "{} {}", variance(0), variance(1));
    assert!(off < 1.0 && (found.motion[1][0] - 2.0).abs() < 1e-9, "{off}");
}

/// White noise of standard deviation 1 smoothed by a Gaussian of `length` px, with the standard deviation 1
/// again: errors go together as `exp(-d^2 / (4 l^2))`.
fn smoothed(width: usize, height: usize, length: f64, rng: CounterRng) -> Vec<f64> {
    let reach = (3.0 * length).ceil() as i64;
    let weight: Vec<f64> = (-reach..=reach).map(|d| (-0.5 * (d as f64 / length).powi(2)).exp()).collect();
    let norm = weight.iter().map(|w| w * w).sum::<f64>().sqrt();
    let (w, h) = (width as i64 + 2 * reach, height as i64 + 2 * reach);
    let white: Vec<f64> = (0..w * h).map(|k| rng.normal(k as u64)).collect();
    let sum = |at: &dyn Fn(usize) -> f64| (0..weight.len()).map(|k| weight[k] * at(k)).sum::<f64>() / norm;
    let mut rows = vec![0.0; width * h as usize];
    for y in 0..h as usize {
        for x in 0..width {
            rows[y * width + x] = sum(&|k| white[y * w as usize + x + k]);
        }
    }
    let mut out = vec![0.0; width * height];
    for y in 0..height {
        for x in 0..width {
            out[y * width + x] = sum(&|k| rows[(y + k) * width + x]);
        }
    }
    out
}

/// The field of a motion past a smooth scene with noise that goes together over 3 px.
fn drive(motion: &Motion, seed: u64) -> FlowField<f64> {
    let rng = CounterRng::new(seed);
    let phase = std::f64::consts::TAU * rng.uniform(0);
    let mut field = field(1, 3.0, |px, py| {
        let [x, y] = camera().to_plane([px, py]);
        let (a, b) = (9.0 * x + phase, 7.0 * y - phase);
        let nu = 0.006 * (1.0 + 0.4 * a.sin() + 0.3 * b.cos());
        let surface = [nu, 0.006 * 0.4 * 9.0 * a.cos(), -0.006 * 0.3 * 7.0 * b.sin()];
        let [u, v, slopes @ ..] = motion.affine_flow([x, y], surface);
        // With equal focal lengths slopes are the same in pixels.
        [FOCAL * u, FOCAL * v, slopes[0], slopes[1], slopes[2], slopes[3]]
    });
    let n = field.len();
    for (i, deviation) in NOISE.into_iter().enumerate() {
        let noise = smoothed(field.width, field.height, 3.0, rng.stream(1 + i as u64));
        for site in 0..n {
            field.motion[i * n + site] += deviation * noise[site];
        }
    }
    field
}

/// Squared distance of the truth in units of the covariance.
fn squared(found: &MotionEstimate, truth: &Motion) -> f64 {
    let off: Vec<f64> = (0..3).map(|i| truth.translation[i] - found.motion.translation[i]).collect();
    let along = |axis: usize| (0..3).map(|i| found.tangent[axis][i] * off[i]).sum::<f64>();
    let turn = |i: usize| truth.rotation[i] - found.motion.rotation[i];
    let error = SVector::<f64, 5>::from_column_slice(&[along(0), along(1), turn(0), turn(1), turn(2)]);
    let covariance = SMatrix::<f64, 5, 5>::from_fn(|i, j| found.covariance[i][j]);
    (error.transpose() * covariance.try_inverse().unwrap() * error)[0]
}

#[test]
fn six_to_twenty_patches_determine_the_motion_and_say_how_surely() {
    let truth = Motion::new([0.6, 0.2, 0.75], [0.002, -0.003, 0.001]);
    let options = MotionOptions { placement: Placement::Start, ..MotionOptions::default() };
    for (size, number, most) in [(60, 20, 0.8), (100, 6, 2.2)] {
        let (mut ok, mut held, mut sum, mut errors) = (0, 0, 0.0, Vec::new());
        for seed in 0..12 {
            let patches = field_patches(&drive(&truth, seed), size, None).unwrap();
            assert_eq!(patches.points.len(), number);
            let found = estimate_patch_motion(&patches.seen_by(&camera()), &options).unwrap();
            errors.push(found.motion.angle_to(&truth).to_degrees());
            let square = squared(&found, &truth);
            ok += u32::from(found.status == MotionStatus::Ok);
            held += u32::from(square < 11.07);
            sum += square;
        }
        errors.sort_by(f64::total_cmp);
        assert!(ok >= 10 && held >= 11 && errors[6] < most, "{size}: {held} of {ok}, {}", errors[12]);
        // This noise has no tail, so that the area over which it is one is smaller than the one that is
        // reckoned with.
        let mean = sum / 12.0 / 5.0 * AREA / (4.0 * std::f64::consts::PI);
        assert!((0.4..2.2).contains(&mean), "{size}: {mean}");
    }
}
