//! Estimates of steady motion fused over time: how the error falls, what the covariance says of it, and what
//! happens where motion changes or frames have holes.

use jacoflow::flow::coarse_to_fine::CoarseToFineOptions;
use jacoflow::flow::windowed::WindowedOptions;
use jacoflow::flow::{Estimator, EstimatorOptions, Method};
use jacoflow::image::Preprocess;
use jacoflow::synth::{AffineTexture, Scene, Sensor};
use jacoflow::temporal::{FlowStream, RecursiveFusion, RecursiveOptions, StreamPlan};
use jacoflow::types::{AnyFrame, FlowField, Frame, Rect, SamplingGrid, Status};
use nalgebra::{Matrix6, Vector6};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

const SIDE: usize = 88;
const REST: [f64; 6] = [0.0; 6];
const SLOW: [f64; 6] = [0.1, 0.05, 0.003, 0.006, -0.006, 0.003];
const REFERENCE: [f64; 6] = [0.3, -0.2, 0.01, 0.02, -0.02, 0.01];
const FAST: [f64; 6] = [3.3, -2.2, 0.003, 0.006, -0.006, 0.003];

fn common() -> EstimatorOptions {
    let region = Some(Rect { x: 24, y: 24, width: 40, height: 40 });
    EstimatorOptions {
        sites: SamplingGrid::Grid { region, stride: 5 },
        covariance: true,
        systematic: true,
        ..EstimatorOptions::default()
    }
}

fn windowed() -> Method {
    Method::Windowed(WindowedOptions::default())
}

fn coarse_to_fine(frames: usize) -> Method {
    Method::CoarseToFine(CoarseToFineOptions { frames, ..CoarseToFineOptions::default() })
}

/// The scene at a time, drawn once.
fn picture(motion: [f64; 6], time: usize) -> Arc<Frame<f64>> {
    type Drawn = BTreeMap<([u64; 6], usize), Arc<Frame<f64>>>;
    static DRAWN: Mutex<Drawn> = Mutex::new(BTreeMap::new());
    let draw = || AffineTexture::moving((SIDE, SIDE), motion, 5).unwrap().frame(time as f64);
    let mut drawn = DRAWN.lock().unwrap();
    Arc::clone(drawn.entry((motion.map(f64::to_bits), time)).or_insert_with(|| Arc::new(draw())))
}

/// What an 8-bit camera sees at these times.
fn seen(motion: [f64; 6], noise: f64, times: impl Iterator<Item = usize>, seed: u64) -> Vec<Arc<Frame<f32>>> {
    let camera = Sensor::eight_bit(noise, seed);
    let frame = |(k, t): (usize, usize)| camera.apply(&picture(motion, t), k as u64).map(|&v| v as f32);
    times.enumerate().map(frame).map(Arc::new).collect()
}

fn frames(motion: [f64; 6], noise: f64, count: usize, seed: u64) -> Vec<Arc<Frame<f32>>> {
    seen(motion, noise, 0..count, seed)
}

fn stream(estimator: Estimator, recursive: Option<RecursiveOptions>) -> FlowStream<f32> {
    FlowStream::new(StreamPlan::new(estimator, Preprocess::default(), recursive).unwrap()).unwrap()
}

fn any(frame: &Frame<f32>) -> AnyFrame {
    AnyFrame::F32(frame.clone())
}

/// The true motion, which is affine about the middle of the frame.
fn truth([u, v, u_x, v_x, u_y, v_y]: [f64; 6], field: &FlowField<f32>, site: usize) -> Vector6<f64> {
    let (x, y) = field.layout.sites.pixel(site % field.width, site / field.width);
    let middle = (SIDE as f64 - 1.0) / 2.0;
    let (x, y) = (x as f64 - middle, y as f64 - middle);
    [u + u_x * x + u_y * y, v + v_x * x + v_y * y, u_x, v_x, u_y, v_y].into()
}

fn errors(motion: [f64; 6], field: &FlowField<f32>) -> Vec<Vector6<f64>> {
    let error = |site| Vector6::from(field.affine(site).to_array().map(f64::from)) - truth(motion, field, site);
    (0..field.len()).map(error).collect()
}

/// Mean squared flow error, and mean of `e^T C^-1 e`.
fn score(motion: [f64; 6], field: &FlowField<f32>) -> (f64, f64) {
    let (mut square, mut normalised) = (0.0, 0.0);
    for (site, e) in errors(motion, field).into_iter().enumerate() {
        let c = field.covariance_at(site).unwrap();
        let inverse = Matrix6::from_fn(|i, j| c[i][j]).try_inverse().unwrap();
        square += (e[0] * e[0] + e[1] * e[1]) / field.len() as f64;
        normalised += (e.transpose() * inverse * e)[0] / field.len() as f64;
    }
    (square, normalised)
}

/// Least-squares slope of `y` over `x`.
fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let (x, y) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
    points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>() / points.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>()
}

/// Root mean square flow error after 1, 2, 4, 8 and 16 estimates, none of which shares a frame with another,
/// over a few realisations.
fn law(method: &Method, motion: [f64; 6], noise: f64, realisations: u64) -> Vec<f64> {
    let estimator = Estimator::new(method.clone(), common()).unwrap();
    let needed = estimator.frames_needed();
    let mut squares = Vec::new();
    for seed in 0..realisations {
        let mut fusion = RecursiveFusion::new(&estimator, RecursiveOptions { forgetting: 1.0 }).unwrap();
        let frames = frames(motion, noise, 16 * needed, seed);
        for (k, group) in frames.chunks(needed).enumerate() {
            let mut field = estimator.estimate(&group.iter().map(AsRef::as_ref).collect::<Vec<_>>(), k).unwrap();
            fusion.fuse(&mut field).unwrap();
            if (k + 1).is_power_of_two() {
                let place = (k + 1).ilog2() as usize;
                squares.resize(squares.len().max(place + 1), 0.0);
                squares[place] += score(motion, &field).0 / realisations as f64;
            }
        }
    }
    squares.into_iter().map(f64::sqrt).collect()
}

/// Frames with independent noise: the error falls with the root of their number, until the bias of an
/// estimate is reached (none at rest).
#[test]
fn the_error_falls_with_the_root_of_the_frames() {
    // Wide windows leave few independent errors in a frame, so that their law needs more of them.
    for (name, method, motion, noise, realisations, most) in
        [("windowed", windowed(), REST, 4.0, 4, -0.44), ("coarse to fine", coarse_to_fine(3), REST, 6.0, 20, -0.4)]
    {
        let errors = law(&method, motion, noise, realisations);
        let points: Vec<_> = errors.iter().enumerate().map(|(k, e)| (k as f64 * 2.0_f64.ln(), e.ln())).collect();
        let slope = slope(&points);
        println!("{name}, {motion:?}, noise {noise}: slope {slope:.3}, errors {errors:.4?}");
        assert!((-0.6..most).contains(&slope), "{name}, {motion:?}: {slope}, {errors:?}");
    }
}

/// Streams, whose estimates share frames: the error stays below the root law, down to a floor that the
/// covariance tells, and the covariance is never too narrow.
#[test]
fn a_stream_shows_its_errors_down_to_the_floor() {
    for (name, method, motion, noise) in [
        ("windowed", windowed(), REST, 4.0),
        ("windowed", windowed(), SLOW, 1.0),
        ("windowed", windowed(), REFERENCE, 1.0),
        ("windowed", windowed(), REFERENCE, 4.0),
        ("windowed pairs", Method::Windowed(WindowedOptions::pair()), SLOW, 4.0),
    ] {
        let estimator = Estimator::new(method, common()).unwrap();
        let mut stream = stream(estimator, Some(RecursiveOptions::default()));
        let (mut first, mut last) = (None, (0.0, 0.0));
        for frame in frames(motion, noise, 26, 1) {
            let Some(field) = stream.push(any(&frame)).unwrap() else { continue };
            last = score(motion, &field);
            first.get_or_insert(last.0);
            assert!(last.1 < 8.5, "{name}, {motion:?}, noise {noise}: {}", last.1);
            let told = field.standard_deviation("u").unwrap();
            let told = told.iter().map(|s| f64::from(*s).powi(2)).sum::<f64>() / told.len() as f64;
            assert!(last.0 < 2.0 * 1.5 * told, "{name}, {motion:?}, noise {noise}: {} {told}", last.0);
        }
        let gained = (first.unwrap() / last.0).sqrt();
        println!("{name}, {motion:?}, noise {noise}: {gained:.1} times nearer, normalised {:.1}", last.1);
        assert!(gained > 1.3 && last.1 < 6.5, "{name}, {motion:?}, noise {noise}: {gained} {}", last.1);
    }
}

/// Noise of consecutive estimates, which the fusion takes for independent: correlated negatively, if at all.
#[test]
fn shared_frames_correlate_errors_negatively() {
    const REALISATIONS: u64 = 4;
    const COUNT: usize = 12;
    for (name, method, motion) in [
        ("windowed", windowed(), REST),
        ("windowed", windowed(), REFERENCE),
        ("windowed pairs", Method::Windowed(WindowedOptions::pair()), SLOW),
        ("coarse to fine", coarse_to_fine(3), FAST),
        ("coarse to fine, pairs", coarse_to_fine(2), FAST),
    ] {
        let estimator = Estimator::new(method, common()).unwrap();
        let needed = estimator.frames_needed();
        // Errors about their mean over the realisations: `runs[realisation][time][site]`.
        let mut runs: Vec<Vec<Vec<Vector6<f64>>>> = (0..REALISATIONS)
            .map(|seed| {
                let frames = frames(motion, 4.0, COUNT + needed - 1, seed);
                let groups = frames.windows(needed);
                groups
                    .map(|g| {
                        let field = estimator.estimate(&g.iter().map(AsRef::as_ref).collect::<Vec<_>>(), 0).unwrap();
                        errors(motion, &field)
                    })
                    .collect()
            })
            .collect();
        for time in 0..COUNT {
            for site in 0..runs[0][0].len() {
                let mean = runs.iter().map(|run| run[time][site]).sum::<Vector6<f64>>() / REALISATIONS as f64;
                for run in &mut runs {
                    run[time][site] -= mean;
                }
            }
        }
        let correlation = |lag: usize| {
            let (mut both, mut own) = (Vector6::zeros(), Vector6::zeros());
            for run in &runs {
                for time in 0..COUNT - lag {
                    for (a, b) in run[time].iter().zip(&run[time + lag]) {
                        both += a.component_mul(b);
                        own += (a.component_mul(a) + b.component_mul(b)) / 2.0;
                    }
                }
            }
            both.component_div(&own).mean()
        };
        let found: Vec<f64> = (1..4).map(correlation).collect();
        println!("{name}, {motion:?}: correlation over 1, 2, 3 frames {found:.2?}");
        assert!(found.iter().all(|c| *c < 0.12) && found.iter().sum::<f64>() < 0.0, "{name}, {motion:?}: {found:?}");
    }
}

/// A motion that turns round is followed at once: estimates are not averaged with those of another motion.
#[test]
fn a_changed_motion_is_followed_at_once() {
    const TURN: usize = 13;
    let back = REFERENCE.map(|v| -v);
    for method in [windowed(), coarse_to_fine(3)] {
        let name = method.name();
        let estimator = || Estimator::new(method.clone(), common()).unwrap();
        let mut plain = stream(estimator(), None);
        let mut fused = stream(estimator(), Some(RecursiveOptions::default()));
        let times = (0..=TURN).chain((0..TURN).rev());
        let mut worst = 0.0_f64;
        for (k, frame) in seen(REFERENCE, 2.0, times, 1).into_iter().enumerate() {
            let (one, other) = (plain.push(any(&frame)).unwrap(), fused.push(any(&frame)).unwrap());
            // Until the three frames are all of the way back.
            let (Some(one), Some(other), true) = (one, other, k > TURN + 1) else { continue };
            let (single, (error, normalised)) = (score(back, &one), score(back, &other));
            println!("{name}, {} frames after the turn: {error:.6} and {:.6}, {normalised:.1}", k - TURN, single.0);
            worst = worst.max(single.0);
            assert!(error < 1.2 * worst, "{name} {k}: {error} {worst}");
            assert!(normalised < 2.0 * single.1.max(7.0), "{name} {k}: {normalised} {}", single.1);
        }
    }
}

/// A hole in one frame costs the times that see it, and those only.
#[test]
fn a_hole_damages_its_time_only() {
    let estimator = Estimator::new(windowed(), common()).unwrap();
    let mut stream = stream(estimator, Some(RecursiveOptions::default()));
    let mut variance = 0.0;
    for (t, frame) in frames(SLOW, 2.0, 12, 1).into_iter().enumerate() {
        let mut frame = (*frame).clone();
        if t == 6 {
            frame.data_mut()[44 * SIDE + 44] = f32::NAN;
        }
        let Some(field) = stream.push(AnyFrame::F32(frame)).unwrap() else { continue };
        let site = 4 * 8 + 4;
        let now = field.covariance_at(site).unwrap()[0][0];
        let seen = (6..9).contains(&t);
        assert_eq!(field.status[site], if seen { Status::Predicted } else { Status::Ok }, "{t}");
        // Information is forgotten, what is systematic stays.
        assert!(!seen || (now > variance && now < 1.06 * variance), "{t}: {now} {variance}");
        assert!(field.status[0] == Status::Ok && score(SLOW, &field).1 < 8.5);
        variance = now;
    }
}
