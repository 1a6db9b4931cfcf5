//! The coarse-to-fine estimate on scenes with exact truth: large motions, pairs and triples, an edge between
//! motions, holes, and its conventions.

use jacoflow::flow::coarse_to_fine::{CoarseToFineOptions, Preset};
use jacoflow::flow::{Estimator, EstimatorOptions, InitialFlow, Method};
use jacoflow::parallel::Threads;
use jacoflow::simd::Level;
use jacoflow::synth::{AffineTexture, Scene, SceneOptions, Sensor, build, mean_truth};
use jacoflow::types::{FlowField, Frame, Rect, SamplingGrid, Status};
use std::sync::Arc;

const SIZE: usize = 160;
/// Left out along each side, px: what enters the frame has no counterpart.
const MARGIN: usize = 24;
/// Some 7 px with rotation, expansion and shear.
const FAST: [f64; 6] = [5.6, -4.7, 0.02, 0.03, -0.02, 0.01];

fn scene(motion: [f64; 6]) -> AffineTexture {
    AffineTexture::moving((SIZE, SIZE), motion, 5).unwrap()
}

/// What an 8-bit camera sees of the scene.
fn frames(scene: &dyn Scene, noise: f64, times: &[f64]) -> Vec<Frame<f32>> {
    let camera = Sensor::eight_bit(noise, 3);
    times.iter().map(|&t| camera.apply(&scene.frame(t), (t + 9.0) as u64).map(|&value| value as f32)).collect()
}

fn estimate(options: CoarseToFineOptions, common: EstimatorOptions, frames: &[Frame<f32>]) -> FlowField<f32> {
    let estimator = Estimator::new(Method::CoarseToFine(options), common).unwrap();
    estimator.estimate(&frames.iter().collect::<Vec<_>>(), 0).unwrap()
}

/// Root mean square errors of flow (px) and Jacobian (1/frame) inside the margin.
fn errors(field: &FlowField<f32>, truth: &FlowField<f64>) -> (f64, f64) {
    let (mut sums, mut count) = ([0.0; 2], 0.0);
    for y in MARGIN..SIZE - MARGIN {
        for x in MARGIN..SIZE - MARGIN {
            let (got, want) = (field.affine(y * SIZE + x).to_array(), truth.affine(y * SIZE + x).to_array());
            for k in 0..6 {
                sums[usize::from(k > 1)] += (f64::from(got[k]) - want[k]).powi(2);
            }
            count += 1.0;
        }
    }
    ((sums[0] / count).sqrt(), (sums[1] / (4.0 * count)).sqrt())
}

#[test]
fn motions_of_many_pixels_are_found_from_pairs_and_triples_by_every_preset() {
    let scene = scene(FAST);
    // Pairs and triples give the same: where the pixels are one frame later.
    let truth = mean_truth(&scene, 0.0, (0.0, 1.0)).unwrap();
    for preset in Preset::EVERY {
        // The fastest works at half the resolution.
        let (most_flow, most_jacobian) = if preset == Preset::Fast { (0.025, 0.0008) } else { (0.012, 0.0005) };
        for (number, times) in [(2, &[0.0, 1.0][..]), (3, &[-1.0, 0.0, 1.0])] {
            let options = CoarseToFineOptions { preset, frames: number, ..CoarseToFineOptions::default() };
            let field = estimate(options, EstimatorOptions::default(), &frames(&scene, 1.0, times));
            let (flow, jacobian) = errors(&field, &truth);
            println!("{} from {number} frames: flow {flow:.4} px, Jacobian {jacobian:.5}", preset.name());
            let name = preset.name();
            assert!(flow < most_flow && jacobian < most_jacobian, "{name} from {number}: {flow} {jacobian}");
            // What leaves the frame may contradict.
            let consistent = field.status.iter().filter(|s| **s == Status::Ok).count();
            println!("  {consistent} of {} consistent", field.len());
            assert!(field.status.iter().all(|s| s.has_estimate()) && consistent > field.len() * 98 / 100);
        }
    }
}

#[test]
fn three_frames_give_the_step_to_the_next_or_the_mean_of_both() {
    let scene = scene(FAST);
    let frames = frames(&scene, 1.0, &[-1.0, 0.0, 1.0]);
    for (central, own, other) in [(false, (0.0, 1.0), (-1.0, 1.0)), (true, (-1.0, 1.0), (0.0, 1.0))] {
        let options = CoarseToFineOptions { central, ..CoarseToFineOptions::default() };
        let field = estimate(options, EstimatorOptions::default(), &frames);
        let [own, other] = [own, other].map(|between| errors(&field, &mean_truth(&scene, 0.0, between).unwrap()));
        assert!(own.0 < 0.012 && own.1 < 0.0005, "{central}: {own:?}");
        // Half the acceleration, .12 px.
        assert!(other.0 > 0.1, "{central}: {other:?}");
    }
}

/// A disc of 40 px in the column `place` over a ground that moves by -0.5 px a frame, at time `t`.
fn disc(t: f64, place: usize) -> Frame<f32> {
    let behind = scene([-0.5, 0.0, 0.0, 0.0, 0.0, 0.0]).frame(t);
    let skin = AffineTexture::moving((SIZE, SIZE), [0.0; 6], 9).unwrap().frame(0.0);
    Frame::from_fn(SIZE, SIZE, |x, y| {
        let is_disc = (x as f64 - place as f64).hypot(y as f64 - 80.0) < 40.0;
        (if is_disc { skin.get(x + 80 - place, y) } else { behind.get(x, y) }).round() as f32
    })
}

#[test]
fn what_goes_out_of_sight_is_inconsistent() {
    let field = estimate(CoarseToFineOptions::pair(), EstimatorOptions::default(), &[disc(0.0, 80), disc(1.0, 86)]);
    let share = |keep: &dyn Fn(f64, f64) -> bool| {
        let sites = (0..SIZE * SIZE).filter(|at| keep((at % SIZE) as f64 - 80.0, (at / SIZE) as f64 - 80.0));
        let marked: Vec<bool> = sites.map(|at| field.status[at] == Status::Inconsistent).collect();
        marked.iter().filter(|marked| **marked).count() as f64 / marked.len() as f64
    };
    // The ground that the disc will cover, and what neither its old nor its new edge is near to.
    let hidden = share(&|x, y| x.hypot(y) > 40.5 && (x - 6.0).hypot(y) < 39.5 && y.abs() < 20.0);
    let seen = share(&|x, y| x.hypot(y) < 30.0 || (x.hypot(y) > 52.0 && x.abs().max(y.abs()) < 70.0));
    println!("inconsistent: {hidden:.3} of what is covered, {seen:.4} of what stays in sight");
    assert!(hidden > 0.6 && seen < 0.002, "{hidden} {seen}");
    assert!(field.motion.iter().all(|plane| plane.is_finite()));
}

/// A disc that comes 1 px and goes on 3 px, over a ground that moves steadily: neither goes the way of a
/// steady flow.
#[test]
fn objects_that_accelerate_are_where_they_will_be() {
    let frames = [(-1.0, 79), (0.0, 80), (1.0, 83)].map(|(t, place)| disc(t, place));
    let field = estimate(CoarseToFineOptions::default(), EstimatorOptions::default(), &frames);
    let mean = |keep: &dyn Fn(f64) -> bool| {
        let sites = (0..SIZE * SIZE).map(|at| (at, (at / SIZE) as f64 - 80.0, (at % SIZE) as f64 - 80.0));
        let inner = sites.filter(|&(_, y, x)| y.abs() < 56.0 && x.abs() < 56.0 && keep(x.hypot(y)));
        let u: Vec<f64> = inner.map(|(at, ..)| f64::from(field.affine(at).to_array()[0])).collect();
        u.iter().sum::<f64>() / u.len() as f64
    };
    let (disc, ground) = (mean(&|r| r < 30.0), mean(&|r| r > 50.0));
    assert!((disc - 3.0).abs() < 0.1 && (ground + 0.5).abs() < 0.02, "{disc} {ground}");
}

#[test]
fn errors_are_about_as_large_as_the_covariance_says() {
    let scene = scene([3.3, -2.2, 0.01, 0.02, -0.02, 0.01]);
    let truth = mean_truth(&scene, 0.0, (0.0, 1.0)).unwrap();
    for noise in [1.0, 4.0] {
        let common = EstimatorOptions { covariance: true, ..EstimatorOptions::default() };
        let field = estimate(CoarseToFineOptions::pair(), common, &frames(&scene, noise, &[0.0, 1.0]));
        let spread: Vec<Vec<f32>> =
            ["u", "v", "u_x", "v_x", "u_y", "v_y"].iter().map(|name| field.standard_deviation(name).unwrap()).collect();
        for (k, spread) in spread.iter().enumerate() {
            let (mut sum, mut count) = (0.0, 0.0);
            for y in MARGIN..SIZE - MARGIN {
                for x in MARGIN..SIZE - MARGIN {
                    let at = y * SIZE + x;
                    let error = f64::from(field.affine(at).to_array()[k]) - truth.affine(at).to_array()[k];
                    sum += (error / f64::from(spread[at])).powi(2);
                    count += 1.0;
                }
            }
            let ratio = (sum / count).sqrt();
            println!("noise {noise}, parameter {k}: error over standard deviation {ratio:.2}");
            // Of affine motion more is feared than happens: nothing in the frames says that no flow bends.
            assert!((0.44..1.3).contains(&ratio), "noise {noise}, parameter {k}: {ratio}");
        }
    }
}

/// Two textures, each with its own translation, on either side of `x = 80` in the second frame's coordinates
/// of the left one.
fn parted() -> Vec<Frame<f32>> {
    let (left, right) = (scene([1.5, 0.5, 0.0, 0.0, 0.0, 0.0]), scene([-1.0, -1.5, 0.0, 0.0, 0.0, 0.0]));
    [0.0, 1.0]
        .map(|t| {
            let (a, b) = (left.frame(t), right.frame(t));
            Frame::from_fn(SIZE, SIZE, |x, y| {
                (if (x as f64) < 80.0 + 1.5 * t { a.get(x, y) } else { b.get(x, y) }).round() as f32
            })
        })
        .into()
}

#[test]
fn two_motions_stay_apart_at_the_edge_between_them() {
    let field = estimate(CoarseToFineOptions::pair(), EstimatorOptions::default(), &parted());
    let worst = |columns: std::ops::Range<usize>, want: [f32; 2]| {
        let sites = columns.flat_map(|x| (MARGIN..SIZE - MARGIN).map(move |y| y * SIZE + x));
        let mut all: Vec<f32> =
            sites.map(|at| (field.affine(at).u - want[0]).hypot(field.affine(at).v - want[1])).collect();
        all.sort_unstable_by(f32::total_cmp);
        all[all.len() * 9 / 10]
    };
    assert!(worst(60..74, [1.5, 0.5]) < 0.1, "{}", worst(60..74, [1.5, 0.5]));
    assert!(worst(88..102, [-1.0, -1.5]) < 0.1, "{}", worst(88..102, [-1.0, -1.5]));
}

#[test]
fn results_do_not_depend_on_threads_and_sites_are_those_of_the_whole_field() {
    let pair = frames(&scene(FAST), 1.0, &[0.0, 1.0]);
    let with = |threads: usize, sites: SamplingGrid| {
        let threads = Threads::new(Some(threads)).unwrap();
        let common =
            EstimatorOptions { threads, sites, covariance: true, diagnostics: true, ..EstimatorOptions::default() };
        estimate(CoarseToFineOptions::pair(), common, &pair)
    };
    let (one, two) = (with(1, SamplingGrid::default()), with(2, SamplingGrid::default()));
    assert_eq!((&one.motion, &one.covariance, &one.residual), (&two.motion, &two.covariance, &two.residual));
    let region = Some(Rect { x: 11, y: 20, width: 51, height: 40 });
    let part = with(2, SamplingGrid::Grid { region, stride: 3 });
    assert_eq!(part.affine(part.width + 2).to_array(), one.affine(23 * SIZE + 17).to_array());
    let points = with(1, SamplingGrid::Points(vec![(17, 23), (150, 3)]));
    for (k, want) in one.affine(23 * SIZE + 17).to_array().into_iter().enumerate() {
        assert!((points.affine(0).to_array()[k] - want).abs() < 1e-5);
    }
}

#[test]
fn every_instruction_set_agrees_with_single_lanes() {
    let frames = frames(&scene(FAST), 1.0, &[-1.0, 0.0, 1.0]);
    let with = |level| {
        let common = EstimatorOptions { simd: Some(level), covariance: true, ..EstimatorOptions::default() };
        estimate(CoarseToFineOptions::default(), common, &frames)
    };
    let want = with(Level::SCALAR);
    for level in Level::available() {
        let got = with(level);
        let near = got.motion.iter().zip(&want.motion).filter(|(a, b)| (*a - *b).abs() < 1e-3).count();
        assert!(near * 1000 >= 999 * got.motion.len(), "{level:?}: {near} of {}", got.motion.len());
        let agree = got.status.iter().zip(&want.status).filter(|(a, b)| a == b).count();
        assert!(agree * 1000 >= 999 * got.len(), "{level:?}: {agree} of {}", got.len());
    }
}

#[test]
fn memory_kept_from_other_frames_changes_no_bit() {
    let (options, frames) = (CoarseToFineOptions::pair(), frames(&scene(FAST), 1.0, &[0.0, 1.0]));
    let fresh = estimate(options.clone(), EstimatorOptions::default(), &frames);
    let estimator = Estimator::new(Method::CoarseToFine(options), EstimatorOptions::default()).unwrap();
    let other = |width, height| Frame::from_fn(width, height, |x, y| ((x * x + 3 * y) as f32 * 0.37).sin() * 1e5);
    for (width, height) in [(SIZE, SIZE), (240, 90), (17, 301)] {
        let (a, b) = (other(width, height), other(width, height).map(|v| -v));
        estimator.estimate(&[&a, &b], 0).unwrap();
        let field = estimator.estimate(&frames.iter().collect::<Vec<_>>(), 0).unwrap();
        assert!(field == fresh, "after {width} x {height}");
    }
}

#[test]
fn holes_get_their_status_and_their_surroundings_an_estimate() {
    let mut pair = frames(&scene([1.2, 0.8, 0.0, 0.0, 0.0, 0.0]), 1.0, &[0.0, 1.0]);
    for y in 70..80 {
        pair[0].row_mut(y)[60..75].fill(f32::NAN);
    }
    let field = estimate(CoarseToFineOptions::pair(), EstimatorOptions::default(), &pair);
    assert_eq!(field.status[75 * SIZE + 66], Status::NonFinite);
    assert!(field.affine(75 * SIZE + 66).u.is_nan());
    let beside = field.affine(75 * SIZE + 50);
    assert!((beside.u - 1.2).abs() < 0.1 && (beside.v - 0.8).abs() < 0.1, "{beside:?}");
    let lost = field.status.iter().filter(|s| **s != Status::Ok).count();
    assert_eq!(lost, 150);
}

#[test]
fn noise_alone_is_no_motion() {
    let blank = Frame::filled(SIZE, SIZE, 100.0);
    let noisy = |seed: u64| Sensor::eight_bit(3.0, seed).apply(&blank, seed).map(|&value| value as f32);
    let frames = [noisy(1), noisy(2)];
    for preset in Preset::EVERY {
        let options = CoarseToFineOptions { preset, ..CoarseToFineOptions::pair() };
        let field = estimate(options, EstimatorOptions { covariance: true, ..EstimatorOptions::default() }, &frames);
        let (u, spread) = (field.plane("u").unwrap(), field.standard_deviation("u").unwrap());
        let wrong =
            u.iter().zip(&spread).filter(|(u, spread)| u.abs() > 3.0 * **spread).count() as f64 / u.len() as f64;
        println!("{}: {wrong:.3} of the sites claim to move", preset.name());
        assert!(wrong < 0.2, "{}: {wrong}", preset.name());
    }
}

#[test]
fn wide_frames_and_single_levels_find_small_motions() {
    let scene = AffineTexture::moving((200, 20), [1.0, 0.5, 0.0, 0.0, 0.0, 0.0], 5).unwrap();
    let field = estimate(CoarseToFineOptions::pair(), EstimatorOptions::default(), &frames(&scene, 1.0, &[0.0, 1.0]));
    let (u, v) = (field.plane("u").unwrap(), field.plane("v").unwrap());
    let mean = |plane: &[f32]| plane.iter().map(|v| f64::from(*v)).sum::<f64>() / plane.len() as f64;
    assert!((mean(u) - 1.0).abs() < 0.05 && (mean(v) - 0.5).abs() < 0.05, "{} {}", mean(u), mean(v));
}

#[test]
fn constant_frames_are_unobservable_and_small_ones_no_error() {
    let flat = vec![Frame::filled(20, 16, 7.0_f32), Frame::filled(20, 16, 7.0)];
    let field = estimate(CoarseToFineOptions::pair(), EstimatorOptions::default(), &flat);
    assert!(field.status.iter().all(|s| *s == Status::Unobservable) && field.motion.iter().all(|v| v.is_nan()));
    // Frames of different brightness are not brought to each other: their rounding would become texture.
    let (pair, triple) = (CoarseToFineOptions::pair, CoarseToFineOptions::default);
    for (options, values) in
        [(triple(), &[10.0_f32, 60.0, 120.0][..]), (triple(), &[0.2, 0.7, 0.4]), (pair(), &[0.1, 0.3])]
    {
        let flat: Vec<Frame<f32>> = values.iter().map(|value| Frame::filled(160, 160, *value)).collect();
        let field = estimate(options, EstimatorOptions::default(), &flat);
        assert!(field.status.iter().all(|s| *s == Status::Unobservable), "{values:?}");
    }
    let tiny: Vec<Frame<f32>> = (0..2).map(|t| Frame::from_fn(3, 4, |x, y| ((x * y + t) as f32).sin())).collect();
    let field = estimate(CoarseToFineOptions::pair(), EstimatorOptions::default(), &tiny);
    for (at, status) in field.status.iter().enumerate() {
        assert_eq!(field.affine(at).u.is_finite(), *status == Status::Ok);
        assert!(matches!(status, Status::Ok | Status::Unobservable));
    }
}

#[test]
fn options_that_mean_nothing_are_refused_by_name() {
    let refused =
        |options| Estimator::new(Method::CoarseToFine(options), EstimatorOptions::default()).unwrap_err().to_string();
    assert!(refused(CoarseToFineOptions { frames: 4, ..Default::default() }).contains("frames"));
    assert!(refused(CoarseToFineOptions { levels: Some(0), ..Default::default() }).contains("levels"));
    assert!(Preset::parse("quick").unwrap_err().to_string().contains("preset"));
}

/// The same flow at every pixel as a start, but for holes.
fn initial(size: usize, (u, v): (f32, f32)) -> EstimatorOptions {
    let plane = |value: f32| (0..size * size).map(|k| if k % 7 == 0 { f32::NAN } else { value }).collect::<Vec<_>>();
    let flow = InitialFlow::new((size, size), &plane(u), &plane(v)).unwrap();
    EstimatorOptions { initial: Some(Arc::new(flow)), covariance: true, ..EstimatorOptions::default() }
}

#[test]
fn a_motion_of_165_px_is_found_from_a_start_that_is_wrong_by_two() {
    const SIDE: usize = 400;
    for (seed, shift) in [(3, (132.0, -99.0)), (4, (-99.0, -132.0))] {
        let still = ["u_x", "v_x", "u_y", "v_y"].map(|name| (name.to_string(), 0.0));
        let values = [("u".to_string(), shift.0), ("v".to_string(), shift.1)].into_iter().chain(still).collect();
        let (carrier, random_state) = (Some("speckle".into()), seed);
        let options = SceneOptions { width: SIDE, height: SIDE, random_state, carrier, values, ..Default::default() };
        let frames = frames(&*build("affine", &options).unwrap(), 1.0, &[0.0, 1.0]);
        let errors = |common: EstimatorOptions| {
            let field = estimate(CoarseToFineOptions::pair(), common, &frames);
            let inner = (140..SIDE - 140).flat_map(|y| (140..SIDE - 140).map(move |x| y * SIDE + x));
            let error =
                |k: usize| (field.motion[k] as f64 - shift.0).hypot(field.motion[SIDE * SIDE + k] as f64 - shift.1);
            let mut inner: Vec<f64> = inner.map(error).collect();
            inner.sort_by(f64::total_cmp);
            let corner = ((shift.0 > 0.0) as usize * (SIDE - 20) + 10, (shift.1 > 0.0) as usize * (SIDE - 20) + 10);
            (inner[inner.len() / 2], inner[inner.len() * 99 / 100], error(corner.1 * SIDE + corner.0))
        };
        let plain = errors(EstimatorOptions::default());
        let (middle, most, corner) = errors(initial(SIDE, (shift.0 as f32 + 1.6, shift.1 as f32 - 1.2)));
        println!("plain {plain:.3?}, from the start {middle:.3} {most:.3}, corner {corner:.3}");
        assert!(plain.0 > 5.0, "the plain estimate misses it: nothing is shown");
        assert!(middle < 0.05 && most < 0.5 && corner < 4.0);
    }
}

#[test]
fn a_useless_start_changes_nothing() {
    let scene = scene(FAST);
    let truth = mean_truth(&scene, 0.0, (0.0, 1.0)).unwrap();
    for (options, times) in
        [(CoarseToFineOptions::pair(), &[0.0, 1.0][..]), (CoarseToFineOptions::default(), &[-1.0, 0.0, 1.0])]
    {
        let frames = frames(&scene, 1.0, times);
        let (flow, jacobian) = errors(&estimate(options.clone(), EstimatorOptions::default(), &frames), &truth);
        for start in [(0.0, 0.0), (40.0, 40.0), (-25.0, 3.0), (f32::NAN, f32::NAN), (1e30, -1e30)] {
            let field = estimate(options.clone(), initial(SIZE, start), &frames);
            let found = errors(&field, &truth);
            println!("{start:?}: {found:.4?}, without {flow:.4} {jacobian:.5}");
            assert!(found.0 < 1.1 * flow + 0.001 && found.1 < 1.1 * jacobian + 1e-5, "{start:?} {found:?} {flow}");
        }
    }
}
