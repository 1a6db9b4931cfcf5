//! Corners: pixels whose surroundings change brightness along both axes, so that their motion can be seen.

use jacoflow::image::{Border, CORNER_WINDOW, CornerOptions, corner_score, corner_score_into, select_corners};
use jacoflow::math::random::CounterRng;
use jacoflow::parallel::Threads;
use jacoflow::simd::Level;
use jacoflow::types::Frame;
use proptest::prelude::*;

fn noise(width: usize, height: usize, seed: u64) -> Frame<f32> {
    let random = CounterRng::new(seed);
    Frame::from_fn(width, height, |x, y| (255.0 * random.uniform((y * width + x) as u64)) as f32)
}

/// The definition, pixel by pixel in double precision.
fn direct(frame: &Frame<f32>, window: usize) -> Frame<f64> {
    let (width, height) = frame.size();
    let at = |x: isize, y: isize| {
        f64::from(frame.get(Border::Replicate.index(x, width), Border::Replicate.index(y, height)))
    };
    let slopes = |x: isize, y: isize| {
        let sum = |f: &dyn Fn(isize) -> f64| (f(-1) + 2.0 * f(0) + f(1)) / 8.0;
        (sum(&|k| at(x + 1, y + k) - at(x - 1, y + k)), sum(&|k| at(x + k, y + 1) - at(x + k, y - 1)))
    };
    let radius = window as isize / 2;
    Frame::from_fn(width, height, |x, y| {
        let mut tensor = nalgebra::Matrix2::zeros();
        for dy in -radius..=radius {
            for dx in -radius..=radius {
                let column = Border::Replicate.index(x as isize + dx, width) as isize;
                let row = Border::Replicate.index(y as isize + dy, height) as isize;
                let g = slopes(column, row);
                tensor += nalgebra::Matrix2::new(g.0 * g.0, g.0 * g.1, g.0 * g.1, g.1 * g.1);
            }
        }
        tensor.symmetric_eigenvalues().min() / (window * window) as f64
    })
}

#[test]
fn every_level_agrees_with_the_definition() {
    for (size, window) in [((67, 37), 3), ((80, 40), 7), ((33, 18), 1), ((5, 9), 5), ((1, 1), 3), ((2, 40), 3)] {
        let frame = noise(size.0, size.1, 5);
        let want = direct(&frame, window);
        for level in Level::available() {
            let mut got = Frame::default();
            corner_score_into(level, &frame, window, &mut got).unwrap();
            for (got, want) in got.data().iter().zip(want.data()) {
                assert!((f64::from(*got) - want).abs() < 2e-2, "{size:?} {window} {level:?}: {got} {want}");
            }
        }
    }
}

#[test]
fn the_corner_of_a_square_scores_its_edges_do_not() {
    let frame = Frame::from_fn(40, 40, |x, y| if x >= 20 && y >= 20 { 200.0 } else { 50.0f32 });
    let score = corner_score(&frame, CORNER_WINDOW).unwrap();
    assert!(score.get(20, 20) > 100.0 && score.get(30, 20).abs() < 1e-3 && score.get(20, 30).abs() < 1e-3);
    let corners = select_corners(&score, &[], &CornerOptions::default());
    assert_eq!(corners.len(), 1);
    assert!((corners[0][0] - 19.5).abs() <= 1.0 && (corners[0][1] - 19.5).abs() <= 1.0, "{corners:?}");
}

#[test]
fn bad_samples_have_no_corner_in_the_windows_that_touch_them_and_elsewhere_nothing_changes() {
    let clean = noise(50, 40, 9);
    let want = corner_score(&clean, 3).unwrap();
    for bad in [f32::NAN, f32::INFINITY] {
        let mut frame = clean.clone();
        frame.row_mut(20)[25] = bad;
        let got = corner_score(&frame, 3).unwrap();
        for y in 0..40usize {
            for x in 0..50usize {
                // 1 px of the slopes and 1 px of the window.
                if x.abs_diff(25) <= 2 && y.abs_diff(20) <= 2 {
                    assert!(got.get(x, y).is_nan(), "{x} {y} {}", got.get(x, y));
                } else {
                    assert_eq!(got.get(x, y), want.get(x, y));
                }
            }
        }
        let options = CornerOptions { max_count: usize::MAX, quality: 0.0, min_distance: 0.0, margin: 0 };
        let corners = select_corners(&got, &[], &options);
        assert!(!corners.is_empty() && corners.iter().all(|c| (c[0] - 25.0).abs() > 2.0 || (c[1] - 20.0).abs() > 2.0));
    }
}

#[test]
fn scores_are_identical_for_any_number_of_threads() {
    let frame = noise(300, 250, 3);
    let run = |n| Threads::new(Some(n)).unwrap().install(|| corner_score(&frame, 5).unwrap());
    let one = run(1);
    assert!(run(2) == one && run(3) == one);
}

#[test]
fn a_window_without_a_centre_is_refused() {
    for window in [0, 4, 33] {
        let message = corner_score(&noise(9, 9, 1), window).unwrap_err().to_string();
        assert!(message.starts_with("window: expected an odd integer") && message.ends_with(&window.to_string()));
    }
}

/// The definition: all local maxima sorted, each compared with everything chosen before it.
fn direct_selection(score: &Frame<f32>, existing: &[[f64; 2]], options: &CornerOptions) -> Vec<[f64; 2]> {
    let (width, height) = score.size();
    let best = score.data().iter().copied().filter(|v| !v.is_nan()).fold(0.0, f32::max);
    let threshold = (f64::from(best) * options.quality) as f32;
    let mut all = Vec::new();
    for y in options.margin..height.saturating_sub(options.margin) {
        for x in options.margin..width.saturating_sub(options.margin) {
            let value = score.get(x, y);
            let mut is_maximum = value > 0.0 && value >= threshold;
            for v in y.saturating_sub(1)..(y + 2).min(height) {
                for u in x.saturating_sub(1)..(x + 2).min(width) {
                    is_maximum &= score.get(u, v).is_nan() || score.get(u, v) <= value;
                }
            }
            if is_maximum {
                all.push((value, [x as f64, y as f64]));
            }
        }
    }
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut chosen: Vec<[f64; 2]> = Vec::new();
    for (_, p) in all {
        let near = |q: &[f64; 2]| (p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2) < options.min_distance.powi(2);
        if chosen.len() < options.max_count && !chosen.iter().chain(existing).any(near) {
            chosen.push(p);
        }
    }
    chosen
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn selection_is_that_of_the_definition(
        seed in 0u64..1000, width in 1usize..90, height in 1usize..60, max_count in 0usize..400, quality in 0.0..0.9f64,
        min_distance in 0.0..12.0f64, margin in 0usize..4, count in 0usize..40,
    ) {
        let random = CounterRng::new(seed);
        // Few different scores, so that there are ties; some are NaN.
        let mut score = noise(width, height, seed).map(|v| (v / 8.0).floor());
        for k in 0..width * height / 30 {
            let at = (random.uniform(k as u64) * (width * height) as f64) as usize;
            score.data_mut()[at] = f32::NAN;
        }
        let existing: Vec<[f64; 2]> = (0..count as u64)
            .map(|k| [100_000 + 2 * k, 100_001 + 2 * k].map(|k| 110.0 * random.uniform(k) - 10.0))
            .collect();
        let options = CornerOptions { max_count, quality, min_distance, margin };
        prop_assert_eq!(select_corners(&score, &existing, &options), direct_selection(&score, &existing, &options));
    }
}
