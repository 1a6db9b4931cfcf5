//! Flow at single points.

use jacoflow::flow::points::{PointFlowOptions, PointPyramid, track_points};
use jacoflow::math::median;
use jacoflow::parallel::Threads;
use jacoflow::simd::Level;
use jacoflow::synth::{AffineTexture, Scene};
use jacoflow::types::Frame;

/// Frames 0 and 1 of a texture in uniform motion, noise-free and unrounded.
fn pair(size: (usize, usize), flow: [f64; 2]) -> [Frame<f32>; 2] {
    let scene = AffineTexture::moving(size, [flow[0], flow[1], 0.0, 0.0, 0.0, 0.0], 4).unwrap();
    [0.0, 1.0].map(|t| scene.frame(t).map(|&v| v as f32))
}

fn pyramids(frames: &[Frame<f32>; 2]) -> [PointPyramid; 2] {
    frames.clone().map(|frame| PointPyramid::new(frame, 3))
}

/// Points every 7 px, off the pixel centres, `margin` px away from the border.
fn lattice((width, height): (usize, usize), margin: f64) -> Vec<[f64; 2]> {
    let along =
        |size: usize| (0..).map(move |k| margin + 7.3 * f64::from(k)).take_while(move |&v| v < size as f64 - margin);
    along(height).flat_map(|y| along(width).map(move |x| [x, y])).collect()
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[test]
fn uniform_motion_is_found_to_a_fraction_of_a_pixel() {
    // Eleven pixels are near the reach of three levels on structure of 2 px.
    for (flow, window, share) in [([0.4, -0.3], 11, 0.95), ([1.37, 2.61], 19, 0.95), ([-9.2, 6.7], 19, 0.8)] {
        let size = (180, 140);
        let [before, after] = pyramids(&pair(size, flow));
        let points = lattice(size, 24.0);
        let options = PointFlowOptions { window, ..PointFlowOptions::default() };
        let found = track_points(&before, &after, &points, None, &options).unwrap();
        let mut errors: Vec<f64> = found.iter().map(|f| distance(f.flow, flow)).collect();
        let kept = found.iter().filter(|f| f.ok).count() as f64 / points.len() as f64;
        let typical = median(&mut errors).unwrap();
        assert!(typical < 0.02 && kept >= share, "{flow:?}: {typical}, {kept}");
        for found in found.iter().filter(|f| f.ok) {
            assert!(found.error <= 0.7);
            assert!(distance(found.flow, flow) > 0.1 || found.residual < 3.0, "{found:?}");
        }
    }
}

/// Gradient steps at full size, in double precision and sample by sample.
fn direct(frames: &[Frame<f32>; 2], point: [f64; 2], options: &PointFlowOptions) -> [f64; 2] {
    let sample = |frame: &Frame<f32>, x: f64, y: f64| {
        let at = |x: f64, y: f64| {
            let column = x.clamp(0.0, frame.width() as f64 - 1.0) as usize;
            f64::from(frame.get(column, y.clamp(0.0, frame.height() as f64 - 1.0) as usize))
        };
        let (left, top) = (x.floor(), y.floor());
        let (fx, fy) = (x - left, y - top);
        let above = (1.0 - fx) * at(left, top) + fx * at(left + 1.0, top);
        let below = (1.0 - fx) * at(left, top + 1.0) + fx * at(left + 1.0, top + 1.0);
        (1.0 - fy) * above + fy * below
    };
    let half = options.window as i32 / 2;
    let mut flow = nalgebra::Vector2::zeros();
    for _ in 0..options.max_steps {
        let (mut tensor, mut rhs) = (nalgebra::Matrix2::zeros(), nalgebra::Vector2::zeros());
        for dy in -half..=half {
            for dx in -half..=half {
                let (x, y) = (point[0] + f64::from(dx), point[1] + f64::from(dy));
                let first = |x: f64, y: f64| sample(&frames[0], x, y);
                let slope = nalgebra::Vector2::new(
                    0.5 * (first(x + 1.0, y) - first(x - 1.0, y)),
                    0.5 * (first(x, y + 1.0) - first(x, y - 1.0)),
                );
                tensor += slope * slope.transpose();
                rhs += slope * (first(x, y) - sample(&frames[1], x + flow[0], y + flow[1]));
            }
        }
        let step = tensor.lu().solve(&rhs).unwrap();
        flow += step;
        if step.norm() < options.min_step {
            break;
        }
    }
    [flow[0], flow[1]]
}

#[test]
fn every_instruction_set_takes_the_steps_of_the_definition() {
    let size = (71, 53);
    let frames = pair(size, [0.8, -0.6]);
    let [before, after] = pyramids(&frames);
    // Some windows hang over the border.
    let points = lattice(size, 3.1);
    for window in [3, 7, 11, 15, 19, 33] {
        let options = PointFlowOptions { levels: 1, window, min_step: 1e-4, ..PointFlowOptions::default() };
        let mut compared = 0;
        for simd in Level::available() {
            let options = PointFlowOptions { simd: Some(simd), ..options };
            for (found, &point) in track_points(&before, &after, &points, None, &options).unwrap().iter().zip(&points) {
                // Where the window is small or cut, steps may diverge; the definition's, too.
                if found.ok && found.error < 0.1 {
                    let want = direct(&frames, point, &options);
                    assert!(distance(found.flow, want) < 2e-3, "{simd:?} {window} {point:?} {:?} {want:?}", found.flow);
                    compared += 1;
                }
            }
        }
        assert!(compared * 10 > Level::available().len() * points.len() * 7, "{window}: {compared}");
    }
}

#[test]
fn results_are_identical_for_any_number_of_threads() {
    let size = (160, 120);
    let [before, after] = pyramids(&pair(size, [2.3, -1.1]));
    let points = lattice(size, 1.0);
    let bits = |n: usize| -> Vec<[u64; 4]> {
        let run = || track_points(&before, &after, &points, None, &PointFlowOptions::default()).unwrap();
        let flows = Threads::new(Some(n)).unwrap().install(run);
        flows.iter().map(|f| [f.flow[0], f.flow[1], f.error, f.residual].map(f64::to_bits)).collect()
    };
    let one = bits(1);
    assert!(bits(2) == one && bits(3) == one);
}

#[test]
fn windows_that_touch_bad_samples_are_lost_and_the_others_are_not() {
    let size = (120, 100);
    let clean = pair(size, [0.4, 0.3]);
    let points = lattice(size, 14.0);
    let options = PointFlowOptions { window: 11, ..PointFlowOptions::default() };
    for (frame, bad) in [(0, f32::NAN), (1, f32::NAN), (0, f32::INFINITY), (1, f32::INFINITY)] {
        let mut frames = clean.clone();
        frames[frame].row_mut(50)[60] = bad;
        let [before, after] = pyramids(&frames);
        for simd in Level::available() {
            let options = PointFlowOptions { simd: Some(simd), ..options };
            for (found, point) in track_points(&before, &after, &points, None, &options).unwrap().iter().zip(&points) {
                let reach = (point[0] - 60.0).abs().max((point[1] - 50.0).abs());
                if reach < 5.0 {
                    assert!(!found.ok && found.residual.is_nan(), "{point:?} {found:?}");
                } else if reach > 8.0 {
                    assert!(found.ok && distance(found.flow, [0.4, 0.3]) < 0.1, "{simd:?} {point:?} {found:?}");
                }
            }
        }
    }
}

#[test]
fn points_that_leave_the_picture_or_never_were_in_it_are_lost() {
    let size = (100, 80);
    let [before, after] = pyramids(&pair(size, [4.0, 0.0]));
    let points = [[98.0, 40.0], [-3.0, 40.0], [50.0, 79.6], [f64::NAN, 3.0], [1e300, 0.0], [50.0, 40.0]];
    let found = track_points(&before, &after, &points, None, &PointFlowOptions::default()).unwrap();
    assert!(found[1..5].iter().all(|f| !f.ok && f.flow[0].is_nan() && f.error.is_nan()), "{found:?}");
    assert!(!found[0].ok && found[5].ok);
}

#[test]
fn what_is_hidden_does_not_return_to_where_it_was() {
    let size = (160, 120);
    let mut frames = pair(size, [1.0, 0.5]);
    let other = AffineTexture::moving(size, [0.0; 6], 99).unwrap().frame(0.0);
    for y in 30..90 {
        for x in 50..110 {
            frames[1].row_mut(y)[x] = other.get(x, y) as f32;
        }
    }
    let [before, after] = pyramids(&frames);
    let points: Vec<_> = lattice(size, 12.0).into_iter().filter(|p| distance(*p, [80.0, 60.0]) < 18.0).collect();
    let options = PointFlowOptions { window: 11, ..PointFlowOptions::default() };
    let kept = |options: &PointFlowOptions| {
        track_points(&before, &after, &points, None, options).unwrap().iter().filter(|f| f.ok).count()
    };
    let untested = PointFlowOptions { forward_backward: f64::INFINITY, ..options };
    assert!(4 * kept(&options) <= points.len(), "{} of {}", kept(&options), points.len());
    assert!(kept(&untested) > kept(&options));
}

#[test]
fn frames_without_structure_or_with_one_slope_have_no_flow() {
    for frame in [
        Frame::filled(60, 50, 80.0f32),
        Frame::from_fn(60, 50, |x, _| 5.0 * x as f32),
        Frame::from_fn(60, 50, |_, y| if y % 9 < 4 { 10.0 } else { 200.0 }),
    ] {
        let [before, after] = pyramids(&[frame.clone(), frame]);
        let found =
            track_points(&before, &after, &lattice((60, 50), 15.0), None, &PointFlowOptions::default()).unwrap();
        assert!(!found.is_empty() && found.iter().all(|f| !f.ok && f.flow[0].is_nan()));
    }
}

#[test]
fn a_guess_leads_to_motion_that_is_out_of_reach() {
    let (size, flow) = ((160, 120), [24.0, -17.0]);
    let [before, after] = pyramids(&pair(size, flow));
    let points = lattice(size, 40.0);
    let options = PointFlowOptions { levels: 1, window: 11, ..PointFlowOptions::default() };
    let good = |guesses: Option<&[[f64; 2]]>| {
        let found = track_points(&before, &after, &points, guesses, &options).unwrap();
        found.iter().filter(|f| f.ok && distance(f.flow, flow) < 0.1).count()
    };
    assert_eq!(good(None), 0);
    assert!(good(Some(&vec![[23.0, -16.5]; points.len()])) * 10 > 9 * points.len());
}

#[test]
fn levels_end_before_a_side_is_too_short() {
    let frame = Frame::filled(8, 5, 1.0);
    assert_eq!(PointPyramid::new(frame.clone(), 9), PointPyramid::new(frame, 2));
}

#[test]
fn tiny_frames_and_no_points_are_no_trouble() {
    let options = PointFlowOptions::default();
    let empty = PointPyramid::new(Frame::default(), 3);
    assert!(!track_points(&empty, &empty, &[[0.0; 2]], None, &options).unwrap()[0].ok);
    let tiny = PointPyramid::new(Frame::from_fn(4, 3, |x, y| (x * y) as f32), 3);
    assert!(track_points(&tiny, &tiny, &[], None, &options).unwrap().is_empty());
    let found = track_points(&tiny, &tiny, &[[2.0, 1.0]], None, &options).unwrap()[0];
    assert!(found.ok && found.flow == [0.0; 2] && found.error == 0.0, "{found:?}");
}

#[test]
fn wrong_arguments_are_refused_by_name() {
    let [before, after] = pyramids(&pair((40, 40), [0.0; 2]));
    let other = PointPyramid::new(Frame::filled(41, 40, 0.0), 3);
    let default = PointFlowOptions::default();
    let message = |after: &PointPyramid, guesses: Option<&[[f64; 2]]>, options: &PointFlowOptions| {
        track_points(&before, after, &[[1.0; 2]], guesses, options).unwrap_err().to_string()
    };
    assert_eq!(message(&other, None, &default), "after: expected size (40, 40), got (41, 40)");
    assert!(message(&after, Some(&[]), &default).starts_with("guesses: expected 1 flows"));
    for (name, options) in [
        ("levels", PointFlowOptions { levels: 0, ..default }),
        ("window", PointFlowOptions { window: 10, ..default }),
        ("window", PointFlowOptions { window: 1, ..default }),
        ("max_steps", PointFlowOptions { max_steps: 0, ..default }),
        ("min_step", PointFlowOptions { min_step: -1.0, ..default }),
        ("forward_backward", PointFlowOptions { forward_backward: f64::NAN, ..default }),
        ("min_eigenvalue", PointFlowOptions { min_eigenvalue: -0.1, ..default }),
    ] {
        let message = message(&after, None, &options);
        assert!(message.starts_with(&format!("{name}: expected ")), "{message}");
    }
}
