//! The instantaneous estimator on the reference scene of WO2010/098160 (embodiment 2) and at the edges of its
//! domain; derived quantities, points moved by a field, observability.

use jacoflow::flow::instantaneous::InstantaneousOptions;
use jacoflow::flow::model::ModelKind;
use jacoflow::flow::{Estimator, EstimatorOptions, Method, RankPolicy};
use jacoflow::image::{GaussianSmoother, Quantiser};
use jacoflow::jet::{Neighbourhood, TimeScheme};
use jacoflow::parallel::Threads;
use jacoflow::simd::Level;
use jacoflow::synth::{AffineTexture, RotatingRamp, Scene, Sensor};
use jacoflow::types::{FlowField, Frame, Mask, Rect, SamplingGrid, Status, Units};
use std::f64::consts::PI;

mod advect;
mod derived_quantity;
mod derived_region;
mod derived_region_motion;
mod derived_sharing;
mod derived_value;
mod horn_schunck;
mod intake;
mod least_squares;
mod lucas_kanade;
mod methods;
mod model;
mod observability;
mod points;

const W: f64 = PI / 100.0;

fn estimator(options: InstantaneousOptions, common: EstimatorOptions) -> Estimator {
    Estimator::new(Method::Instantaneous(options), common).unwrap()
}

fn scheme(scheme: TimeScheme) -> InstantaneousOptions {
    InstantaneousOptions { scheme, ..InstantaneousOptions::default() }
}

/// The window of the ramp around (60, 80), and that pixel inside it.
fn ramp(half: usize) -> (RotatingRamp, (usize, usize)) {
    let side = 2 * half + 1;
    (RotatingRamp::reference(side, side).centred_at(60.0, 80.0), (half, half))
}

fn texture(seed: u64) -> Vec<Frame<f64>> {
    let scene = AffineTexture::reference(60, 50, seed).unwrap();
    let sensor = Sensor::eight_bit(2.0, seed);
    (0..3u32).map(|t| sensor.apply(&scene.frame(f64::from(t)), u64::from(t))).collect()
}

fn three<T>(frames: &[Frame<T>]) -> [&Frame<T>; 3] {
    [&frames[0], &frames[1], &frames[2]]
}

fn bits(field: &FlowField<f32>) -> (Vec<u32>, Vec<Status>) {
    (field.motion.iter().map(|v| v.to_bits()).collect(), field.status.clone())
}

#[test]
fn clean_ramp_backward_gives_the_known_digits_at_every_time() {
    let want = [-2.542467, 1.845170, -4.934396e-4, 3.1410759e-2, -3.1410759e-2, -4.934396e-4];
    let (scene, at) = ramp(2);
    let common = EstimatorOptions { sites: SamplingGrid::Points(vec![at]), ..EstimatorOptions::default() };
    let points = estimator(scheme(TimeScheme::Backward), common);
    let dense = estimator(scheme(TimeScheme::Backward), EstimatorOptions::default());
    for t in 2..400u32 {
        let frames: Vec<Frame<f64>> = (t - 2..=t).map(|t| scene.frame(f64::from(t))).collect();
        let field = points.estimate(&three(&frames), t as usize - 2).unwrap();
        assert_eq!((field.status[0], field.layout.frame_index), (Status::Ok, t as usize));
        let all = dense.estimate(&three(&frames), 0).unwrap();
        let (one, same) = (field.affine(0).to_array(), all.affine(at.1 * all.width + at.0).to_array());
        for k in 0..6 {
            assert!((one[k] - want[k]).abs() < 1e-6, "t {t}, {k}: {}", one[k]);
            assert!((same[k] - want[k]).abs() < 1e-6, "dense, t {t}, {k}: {}", same[k]);
        }
    }
}

#[test]
fn clean_ramp_central_is_within_five_ten_thousandths_everywhere() {
    let scene = RotatingRamp::reference(120, 110);
    let frames: Vec<Frame<f64>> = (0..3).map(|t| scene.frame(f64::from(t))).collect();
    let central =
        estimator(scheme(TimeScheme::Central), EstimatorOptions::default()).estimate(&three(&frames), 0).unwrap();
    let backward =
        estimator(scheme(TimeScheme::Backward), EstimatorOptions::default()).estimate(&three(&frames), 0).unwrap();
    assert_eq!(central.layout.frame_index, 1);
    let error = |field: &FlowField<f64>, x: usize, y: usize| {
        let truth = scene.motion(x as f64, y as f64, 1.0).unwrap().to_array();
        let m = field.affine(y * field.width + x).to_array();
        (0..6).map(|k| (m[k] - truth[k]).abs()).fold(0.0, f64::max)
    };
    for y in 1..109 {
        for x in 1..119 {
            // w - sin w, times the coordinate for u and v.
            let bound = 5.3e-6 * x.max(y).max(1) as f64;
            assert!(error(&central, x, y) < bound, "{x} {y}: {}", error(&central, x, y));
        }
    }
    assert!(error(&central, 60, 80) < 5e-4);
    let ratio = error(&backward, 60, 80) / error(&central, 60, 80);
    assert!((50.0..150.0).contains(&ratio), "backward over central: {ratio}");
}

#[test]
fn quantised_and_smoothed_ramp_is_useless_as_the_patent_shows() {
    let (scene, at) = ramp(20);
    let smoother = GaussianSmoother::new(3.0).unwrap();
    let quantiser = Quantiser::default();
    let mut frames: Vec<Frame<f64>> = Vec::new();
    let estimator = estimator(
        scheme(TimeScheme::Backward),
        EstimatorOptions {
            sites: SamplingGrid::Points(vec![at]),
            threads: Threads::new(Some(1)).unwrap(),
            ..EstimatorOptions::default()
        },
    );
    let mut errors = Vec::new();
    for t in 0..402u32 {
        frames.push(smoother.apply(&quantiser.apply(&scene.frame(f64::from(t)))));
        if frames.len() < 3 {
            continue;
        }
        let field = estimator.estimate(&three(&frames), 0).unwrap();
        let m = field.affine(0);
        errors.push(if m.u.is_finite() { (m.u + 80.0 * W).hypot(m.v - 60.0 * W) } else { f64::INFINITY });
        frames.remove(0);
    }
    assert_eq!(errors.len(), 400);
    let close = errors.iter().filter(|e| **e < 0.25).count();
    errors.sort_by(f64::total_cmp);
    let median = 0.5 * (errors[199] + errors[200]);
    println!("median {median:.3} px, {close} of 400 frames within 0.25 px");
    assert!((1.5..=4.0).contains(&median), "median {median}");
    assert!(close < 60, "{close} frames within 0.25 px");
}

#[test]
fn u8_u16_and_unit_floats_give_the_same_flow() {
    let eight = texture(3);
    let run = |gain: f64| {
        let frames: Vec<Frame<f32>> = eight.iter().map(|f| f.map(|v| (v * gain) as f32)).collect();
        estimator(InstantaneousOptions::default(), EstimatorOptions::default()).estimate(&three(&frames), 0).unwrap()
    };
    let want = run(1.0);
    assert!(want.status.iter().filter(|s| **s == Status::Ok).count() > 2500);
    for gain in [257.0, 1.0 / 255.0] {
        let got = run(gain);
        assert_eq!(got.status, want.status);
        for (g, w) in got.motion.iter().zip(&want.motion) {
            assert!(g.is_nan() && w.is_nan() || (g - w).abs() <= 5e-3 * (1.0 + w.abs()), "gain {gain}: {g} {w}");
        }
    }
}

#[test]
fn every_instruction_set_and_precision_agrees() {
    let frames = texture(4);
    let single: Vec<Frame<f32>> = frames.iter().map(|f| f.map(|v| *v as f32)).collect();
    for side in [3, 5] {
        let options = InstantaneousOptions { neighbourhood: Neighbourhood::square(side), ..Default::default() };
        // Diagnostics force the careful path: the oracle.
        let careful = EstimatorOptions { diagnostics: true, ..EstimatorOptions::default() };
        let want = estimator(options.clone(), careful).estimate(&three(&frames), 0).unwrap();
        for level in Level::available() {
            let common = || EstimatorOptions { simd: Some(level), ..EstimatorOptions::default() };
            let double = estimator(options.clone(), common()).estimate(&three(&frames), 0).unwrap();
            let fast = estimator(options.clone(), common()).estimate(&three(&single), 0).unwrap();
            assert_eq!((&double.status, &fast.status), (&want.status, &want.status), "{level:?}");
            for (i, w) in want.motion.iter().enumerate().filter(|(_, w)| w.is_finite()) {
                let c = want.condition.as_ref().unwrap()[i % want.len()];
                let close = |got: f64, epsilon: f64| (got - w).abs() <= epsilon * c * c * (1.0 + w.abs());
                assert!(close(double.motion[i], 1e-12), "{level:?} f64 {i}: {} {w}", double.motion[i]);
                // Fused 3x3 differences whole grey levels exactly; other sizes difference rounded jets.
                let single = if side == 3 { 2e-6 } else { 4e-5 };
                assert!(close(f64::from(fast.motion[i]), single), "{level:?} f32 {i}: {} {w} {c}", fast.motion[i]);
            }
        }
    }
}

#[test]
fn one_and_two_threads_give_the_same_bits() {
    let frames: Vec<Frame<f32>> = texture(5).iter().map(|f| f.map(|v| *v as f32)).collect();
    for covariance in [false, true] {
        let run = |n| {
            let common =
                EstimatorOptions { covariance, threads: Threads::new(Some(n)).unwrap(), ..EstimatorOptions::default() };
            bits(&estimator(InstantaneousOptions::default(), common).estimate(&three(&frames), 0).unwrap())
        };
        assert_eq!(run(1), run(2));
    }
}

#[test]
fn grids_regions_and_points_are_the_dense_field_at_their_pixels() {
    let frames: Vec<Frame<f32>> = texture(6).iter().map(|f| f.map(|v| *v as f32)).collect();
    let run = |sites: SamplingGrid| {
        let common = EstimatorOptions { sites, ..EstimatorOptions::default() };
        estimator(InstantaneousOptions::default(), common).estimate(&three(&frames), 0).unwrap()
    };
    let dense = run(SamplingGrid::default());
    let region = |x, y, width, height| Some(Rect { x, y, width, height });
    let shapes = [
        SamplingGrid::Grid { region: None, stride: 3 },
        SamplingGrid::Grid { region: None, stride: 59 },
        SamplingGrid::Grid { region: region(7, 9, 20, 31), stride: 1 },
        SamplingGrid::Grid { region: region(40, 30, 20, 20), stride: 4 },
        SamplingGrid::Grid { region: region(59, 10, 1, 5), stride: 1 },
        SamplingGrid::Grid { region: region(10, 10, 3, 3), stride: 1 },
        SamplingGrid::Points(vec![(30, 20), (0, 0), (58, 48), (59, 49), (30, 20)]),
    ];
    for sites in shapes {
        let field = run(sites.clone());
        for i in 0..field.len() {
            let (x, y) = sites.pixel(i % field.width, i / field.width);
            let j = y * dense.width + x;
            assert_eq!(field.status[i], dense.status[j], "{sites:?} {x} {y}");
            for p in 0..6 {
                let (g, w) = (field.motion[p * field.len() + i], dense.motion[p * dense.len() + j]);
                assert!(g.is_nan() && w.is_nan() || (g - w).abs() <= 1e-3 * (1.0 + w.abs()), "{sites:?} {g} {w}");
            }
        }
    }
}

#[test]
fn a_field_can_be_filled_again() {
    let (a, b) = (texture(7), texture(8));
    let common = EstimatorOptions { diagnostics: true, covariance: true, ..EstimatorOptions::default() };
    for common in [EstimatorOptions::default(), common] {
        let estimator = estimator(InstantaneousOptions::default(), common);
        let want = estimator.estimate(&three(&b), 5).unwrap();
        let mut field = estimator.estimate(&three(&a), 0).unwrap();
        estimator.estimate_into(&three(&b), 5, &mut field).unwrap();
        assert_eq!(format!("{field:?}"), format!("{want:?}"));
        let mut other = FlowField::empty(want.layout.clone(), false).unwrap();
        other.motion.clear();
        estimator.estimate_into(&three(&b), 5, &mut other).unwrap();
        assert_eq!(format!("{other:?}"), format!("{want:?}"));
    }
}

#[test]
fn a_bad_block_and_a_mask_damage_only_what_touches_them() {
    let mut frames: Vec<Frame<f32>> = texture(9).iter().map(|f| f.map(|v| *v as f32)).collect();
    for y in 10..30 {
        frames[2].row_mut(y)[15..35].fill(if y % 2 == 0 { f32::NAN } else { f32::INFINITY });
    }
    let mask = Mask::from_fn(60, 50, |x, y| !((45..50).contains(&x) && (20..25).contains(&y)));
    for side in [3usize, 5] {
        let r = side / 2;
        let options = InstantaneousOptions { neighbourhood: Neighbourhood::square(side), ..Default::default() };
        let common = EstimatorOptions { mask: Some(mask.clone()), ..EstimatorOptions::default() };
        let field = estimator(options, common).estimate(&three(&frames), 0).unwrap();
        for y in 0..50usize {
            for x in 0..60usize {
                let near =
                    |x0: usize, x1: usize, y0: usize, y1: usize| x + r >= x0 && x < x1 + r && y + r >= y0 && y < y1 + r;
                let want = if x < r || y < r || x + r >= 60 || y + r >= 50 {
                    Status::Border
                } else if near(45, 50, 20, 25) {
                    Status::Masked
                } else if near(15, 35, 10, 30) {
                    Status::NonFinite
                } else {
                    Status::Ok
                };
                let i = y * 60 + x;
                assert_eq!(field.status[i], want, "{x} {y}");
                assert!((0..6).all(|p| field.motion[p * 3000 + i].is_finite() == (want == Status::Ok)), "{x} {y}");
            }
        }
    }
}

#[test]
fn unusable_frames_are_refused_by_name_and_constant_ones_are_not() {
    let estimator_of = |common| estimator(InstantaneousOptions::default(), common);
    let e = estimator_of(EstimatorOptions::default());
    let frame = |w: usize, h: usize| Frame::filled(w, h, 0.7f32);
    let (a, b, small) = (frame(8, 8), frame(8, 9), frame(2, 8));
    for (bad, word) in [
        (vec![&a, &a], "3 frames"),
        (vec![], "3 frames"),
        (vec![&a, &b, &a], "8 x 9"),
        (vec![&small, &small, &small], "2 x 8"),
    ] {
        let message = e.estimate(&bad, 0).unwrap_err().to_string();
        assert!(message.starts_with("frames") && message.contains(word), "{message}");
    }
    let mask = Some(Mask::filled(3, 3, true));
    let wrong =
        estimator_of(EstimatorOptions { mask, ..EstimatorOptions::default() }).estimate(&[&a, &a, &a], 0).unwrap_err();
    assert!(wrong.to_string().starts_with("mask"));
    let smallest = e.estimate(&[&frame(3, 3), &frame(3, 3), &frame(3, 3)], 0).unwrap();
    assert_eq!(smallest.status.iter().filter(|s| **s == Status::Unobservable).count(), 1);
    for level in Level::available() {
        let flat = frame(40, 20);
        let common =
            EstimatorOptions { simd: Some(level), diagnostics: level == Level::SCALAR, ..EstimatorOptions::default() };
        let field = estimator_of(common).estimate(&[&flat, &flat, &flat], 0).unwrap();
        assert_eq!((field.status[0], field.status[41]), (Status::Border, Status::Unobservable));
        assert!(field.motion.iter().all(|v| v.is_nan()));
    }
}

#[test]
fn a_translating_ramp_is_unobservable_in_either_precision_and_has_a_least_norm() {
    // H = 0, M = 0: rank 3. The least-norm motion explains the brightness: the flow along the gradient.
    let make = |t: f64| Frame::from_fn(20, 12, |x, y| 90.3 + 0.7 * (x as f64 - 0.31 * t) + 0.4 * y as f64);
    let frames: Vec<Frame<f64>> = (0..3).map(|t| make(f64::from(t))).collect();
    let single: Vec<Frame<f32>> = frames.iter().map(|f| f.map(|v| *v as f32)).collect();
    let e = estimator(
        InstantaneousOptions::default(),
        EstimatorOptions { diagnostics: true, ..EstimatorOptions::default() },
    );
    let quick = estimator(InstantaneousOptions::default(), EstimatorOptions::default());
    let (a, b) = (e.estimate(&three(&frames), 0).unwrap(), e.estimate(&three(&single), 0).unwrap());
    let (c, d) = (quick.estimate(&three(&frames), 0).unwrap(), quick.estimate(&three(&single), 0).unwrap());
    for y in 1..11 {
        for x in 1..19 {
            let i = y * 20 + x;
            assert_eq!([a.status[i], b.status[i], c.status[i], d.status[i]], [Status::Unobservable; 4], "{x} {y}");
            assert_eq!(a.rank.as_ref().unwrap()[i], 3);
        }
    }
    let options = InstantaneousOptions { rank_deficient: RankPolicy::MinNorm, ..Default::default() };
    let m = estimator(options, EstimatorOptions::default()).estimate(&three(&frames), 0).unwrap();
    assert_eq!(m.status[45], Status::MinNorm);
    let flow = m.affine(45);
    assert!((flow.u * 0.7 + flow.v * 0.4 - 0.31 * 0.7).abs() < 1e-9 && (flow.u * 0.4 - flow.v * 0.7).abs() < 1e-9);
    assert!(flow.u_x.abs() < 1e-9 && flow.v_y.abs() < 1e-9);
}

#[test]
fn covariance_is_that_of_repeated_noise() {
    // A quadratic patch in translation, small pixel noise: the spread of the estimates is what each of them
    // predicts.
    let at = (3, 3);
    let clean: Vec<Frame<f64>> = (0..3)
        .map(|t| {
            Frame::from_fn(7, 7, |x, y| {
                let (x, y) = (x as f64 - 3.0 - 0.2 * f64::from(t), y as f64 - 3.0 + 0.1 * f64::from(t));
                20.0 + 8.0 * x - 5.0 * y + 2.0 * x * x + 1.2 * x * y - 1.7 * y * y
            })
        })
        .collect();
    let sd = 0.01;
    for given in [Some(sd), None] {
        let common = EstimatorOptions {
            covariance: true,
            noise: given,
            sites: SamplingGrid::Points(vec![at]),
            ..EstimatorOptions::default()
        };
        let e = estimator(InstantaneousOptions::default(), common);
        let runs = 3000u64;
        let (mut mean, mut square, mut claimed) = ([0.0; 6], [0.0; 6], [0.0; 6]);
        for k in 0..runs {
            let sensor = Sensor { noise: sd, random_state: k, ..Sensor::default() };
            let frames: Vec<Frame<f64>> = clean.iter().zip(0..).map(|(f, i)| sensor.apply(f, i)).collect();
            let field = e.estimate(&three(&frames), 0).unwrap();
            let (m, c) = (field.affine(0).to_array(), field.covariance_at(0).unwrap());
            for p in 0..6 {
                mean[p] += m[p] / runs as f64;
                square[p] += m[p] * m[p] / runs as f64;
                claimed[p] += c[p][p] / runs as f64;
            }
        }
        for p in 0..6 {
            let ratio = claimed[p] / (square[p] - mean[p] * mean[p]);
            assert!((0.85..1.15).contains(&ratio), "given {given:?}, parameter {p}: claimed over seen {ratio}");
        }
    }
}

#[test]
fn other_models_run_through_the_same_door() {
    // A rigid shift with acceleration: 0.2 t + 0.05 t^2 along x.
    let frames: Vec<Frame<f64>> = (-1..=1)
        .map(|t| {
            let shift = 0.2 * f64::from(t) + 0.05 * f64::from(t * t);
            Frame::from_fn(9, 9, |x, y| {
                let (x, y) = (x as f64 - 4.0 - shift, y as f64 - 4.0);
                50.0 + 6.0 * x - 4.0 * y + 3.0 * x * x + x * y - 2.0 * y * y
            })
        })
        .collect();
    let run = |model| {
        let options = InstantaneousOptions { model, ..Default::default() };
        let common = EstimatorOptions { sites: SamplingGrid::Points(vec![(4, 4)]), ..EstimatorOptions::default() };
        estimator(options, common).estimate(&three(&frames), 0).unwrap()
    };
    let accelerating = run(ModelKind::Accelerating);
    assert_eq!(accelerating.layout.parameters, ["u", "v", "u_t", "v_t"]);
    let [u, v, ut, vt] = [0, 1, 2, 3].map(|p| accelerating.motion[p]);
    assert!((u - 0.2).abs() < 0.02 && v.abs() < 0.02 && (ut - 0.1).abs() < 0.02 && vt.abs() < 0.02);
    let translational = run(ModelKind::Translational);
    assert!((translational.motion[0] - 0.2).abs() < 1e-9 && translational.motion[1].abs() < 1e-9);
    assert_eq!(translational.affine(0).u_x, 0.0);
}

#[test]
fn pixel_pitch_and_frame_period_scale_results_and_change_no_decision() {
    let frames = texture(10);
    let run = |pixel_pitch, covariance| {
        let units = Units::new(pixel_pitch, None, Some(0.04));
        let common = EstimatorOptions { units, covariance, ..EstimatorOptions::default() };
        estimator(InstantaneousOptions::default(), common).estimate(&three(&frames), 0).unwrap()
    };
    for covariance in [false, true] {
        let (px, mm) = (run((1.0, 1.0), covariance), run((0.5, 0.25), covariance));
        assert_eq!(px.status, mm.status);
        assert_eq!(mm.layout.units, Units::new((0.5, 0.25), None, Some(0.04)));
        let i = 25 * 60 + 30;
        let frames = mm.in_pixels_and_frames();
        assert!((frames.affine(i).u - px.affine(i).u * 0.04).abs() < 1e-12);
        let (a, b) = (px.affine(i).to_array(), mm.affine(i).to_array());
        let scale = [0.5, 0.25, 1.0, 0.5, 2.0, 1.0];
        for k in 0..6 {
            assert!((b[k] - a[k] * scale[k]).abs() < 1e-12 * (1.0 + a[k].abs()));
        }
        if covariance {
            let (p, q) = (px.covariance_at(i).unwrap(), mm.covariance_at(i).unwrap());
            assert!((q[0][4] / (p[0][4] * scale[0] * scale[4]) - 1.0).abs() < 1e-12);
        }
    }
}
