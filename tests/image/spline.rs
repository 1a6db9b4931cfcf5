//! The cubic spline against its definition.

use jacoflow::image::Spline;
use jacoflow::math::Real;
use jacoflow::math::random::CounterRng;
use jacoflow::parallel::Threads;
use jacoflow::simd::Level;
use jacoflow::types::Frame;

fn noise<T: Real>(width: usize, height: usize) -> Frame<T> {
    let rng = CounterRng::new(7);
    Frame::from_fn(width, height, |x, y| T::from_f64(255.0 * rng.uniform((y * width + x) as u64)))
}

/// Positions inside and around a frame.
fn positions<T: Real>(count: usize, len: usize, seed: u64) -> Vec<T> {
    let rng = CounterRng::new(seed);
    (0..count).map(|i| T::from_f64((len as f64 + 4.0) * rng.uniform(i as u64) - 2.0)).collect()
}

/// The cubic B-spline as it is defined.
fn b_spline(x: f64) -> f64 {
    let x = x.abs();
    if x < 1.0 {
        2.0 / 3.0 - x * x + 0.5 * x * x * x
    } else if x < 2.0 {
        (2.0 - x).powi(3) / 6.0
    } else {
        0.0
    }
}

/// Which sample lies at `i` when a row of `len` is mirrored about its first and last sample for ever.
fn mirrored(i: isize, len: usize) -> usize {
    let mut i = i;
    let last = len as isize - 1;
    while last > 0 && !(0..=last).contains(&i) {
        i = if i < 0 { -i } else { 2 * last - i };
    }
    if last == 0 { 0 } else { i as usize }
}

/// Solves `(c_(k-1) + 4 c_k + c_(k+1)) / 6 = s_k`, mirrored, by iterating until nothing changes.
fn solve(samples: &[f64]) -> Vec<f64> {
    let mut c = samples.to_vec();
    for _ in 0..120 {
        for k in 0..c.len() {
            let (a, b) = (mirrored(k as isize - 1, c.len()), mirrored(k as isize + 1, c.len()));
            c[k] = if c.len() == 1 { samples[0] } else { (6.0 * samples[k] - c[a] - c[b]) / 4.0 };
        }
    }
    c
}

/// Coefficients column by column and row by row.
fn naive_coefficients<T: Real>(frame: &Frame<T>) -> Frame<f64> {
    let (w, h) = frame.size();
    let columns: Vec<_> =
        (0..w).map(|x| solve(&(0..h).map(|y| frame.get(x, y).to_f64()).collect::<Vec<_>>())).collect();
    let rows: Vec<_> = (0..h).map(|y| solve(&columns.iter().map(|c| c[y]).collect::<Vec<_>>())).collect();
    Frame::from_fn(w, h, |x, y| rows[y][x])
}

/// The sum over the sixteen coefficients around a position.
fn naive_value(coefficients: &Frame<f64>, x: f64, y: f64) -> f64 {
    let (w, h) = coefficients.size();
    let (x, y) = (x.clamp(0.0, w as f64 - 1.0), y.clamp(0.0, h as f64 - 1.0));
    let (left, top) = (x.floor() as isize - 1, y.floor() as isize - 1);
    let mut sum = 0.0;
    for j in top..top + 4 {
        for i in left..left + 4 {
            let weight = b_spline(x - i as f64) * b_spline(y - j as f64);
            sum += weight * coefficients.get(mirrored(i, w), mirrored(j, h));
        }
    }
    sum
}

/// Narrower than a vector, narrower than the filter's reach, one and several bands.
const SIZES: [(usize, usize); 9] = [(1, 1), (5, 1), (1, 40), (2, 3), (9, 2), (17, 66), (70, 61), (131, 62), (45, 150)];

macro_rules! check_against_the_definition {
    ($t:ty, $tolerance:expr) => {{
        type T = $t;
        for (w, h) in SIZES {
            let frame = noise::<T>(w, h);
            let coefficients = naive_coefficients(&frame);
            let anywhere = (positions::<T>(203, w, 1), positions::<T>(203, h, 2));
            // Side by side on a row, as flow without much change has them.
            let column = |i: usize| T::from_f64(i as f64 % w as f64 + 0.3);
            let side_by_side = ((0..203).map(column).collect::<Vec<T>>(), vec![T::from_f64(0.6 * (h - 1) as f64); 203]);
            let all = [&anywhere, &side_by_side];
            for (level, (x, y)) in Level::available().into_iter().flat_map(|level| all.map(|places| (level, places))) {
                let spline = Spline::new(level, &frame);
                for count in [0, 1, 3, 8, 21, 203] {
                    let mut out = vec![T::nan(); count];
                    spline.sample_row(level, x, y, &mut out);
                    for i in 0..count {
                        let want = naive_value(&coefficients, x[i].to_f64(), y[i].to_f64());
                        assert!((out[i].to_f64() - want).abs() < $tolerance, "{w} x {h}, {level:?}: {} {want}", out[i]);
                    }
                }
            }
        }
    }};
}

#[test]
fn every_level_is_the_mirrored_spline_of_the_definition() {
    // f32: positions of up to 150 px are themselves rounded to 1e-5 px, where noise has slopes of hundreds of
    // grey levels a px.
    check_against_the_definition!(f32, 1e-3);
    check_against_the_definition!(f64, 1e-11);
}

macro_rules! check_samples {
    ($t:ty, $tolerance:expr) => {{
        type T = $t;
        for (w, h) in SIZES {
            let frame = noise::<T>(w, h);
            let x: Vec<T> = (0..w).map(|x| T::from_f64(x as f64)).collect();
            for level in Level::available() {
                let spline = Spline::new(level, &frame);
                for y in 0..h {
                    let mut out = vec![T::nan(); w];
                    spline.sample_row(level, &x, &vec![T::from_f64(y as f64); w], &mut out);
                    for (got, want) in out.iter().zip(frame.row(y)) {
                        assert!(
                            (got.to_f64() - want.to_f64()).abs() < $tolerance,
                            "{w} x {h}, {level:?}: {got} {want}"
                        );
                    }
                }
            }
        }
    }};
}

#[test]
fn samples_are_met_to_rounding() {
    check_samples!(f32, 3e-4);
    check_samples!(f64, 1e-12);
}

#[test]
fn cubics_are_exact_far_from_the_edge() {
    let cubic = |x: f64, y: f64| {
        let (x, y) = (0.1 * (x - 40.0), 0.1 * (y - 40.0));
        1.0 + x - 2.0 * y + x * y - 0.5 * x * x + x * x * x - 0.3 * x * x * y + 0.7 * x * y * y * y - 0.2 * y * y * y
    };
    let frame = Frame::from_fn(81, 83, |x, y| cubic(x as f64, y as f64));
    let at: Vec<_> = (0..50).map(|i| (37.0 + 0.123 * f64::from(i), 44.0 - 0.101 * f64::from(i))).collect();
    let (x, y): (Vec<_>, Vec<_>) = at.into_iter().unzip();
    for level in Level::available() {
        let mut out = vec![0.0; 50];
        Spline::new(level, &frame).sample_row(level, &x, &y, &mut out);
        for i in 0..50 {
            assert!((out[i] - cubic(x[i], y[i])).abs() < 1e-11, "{level:?}: {} {}", out[i], cubic(x[i], y[i]));
        }
    }
}

#[test]
fn positions_from_anywhere_stay_inside() {
    let frame = noise::<f32>(20, 10);
    let wild = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30, -1e30, f32::MAX, -0.0, 19.0, 9.0];
    let mut pairs = Vec::new();
    for &x in &wild {
        for &y in &wild {
            pairs.push((x, y));
        }
    }
    let (x, y): (Vec<_>, Vec<_>) = pairs.into_iter().unzip();
    for level in Level::available() {
        let spline = Spline::new(level, &frame);
        let mut out = vec![f32::NAN; x.len()];
        spline.sample_row(level, &x, &y, &mut out);
        for i in 0..out.len() {
            // Rust's casts saturate, and take NaN for zero.
            let want = frame.get((x[i] as usize).min(19), (y[i] as usize).min(9));
            assert!((out[i] - want).abs() < 3e-4, "{level:?} at {}, {}", x[i], y[i]);
        }
    }
}

#[test]
fn an_empty_frame_has_no_brightness() {
    for (w, h) in [(0, 0), (0, 5), (5, 0)] {
        for level in Level::available() {
            let mut out = [0.0f32; 19];
            Spline::new(level, &Frame::filled(w, h, 1.0)).sample_row(level, &[0.0; 19], &[0.0; 19], &mut out);
            assert!(out.iter().all(|v| v.is_nan()));
        }
    }
}

#[test]
fn neither_threads_nor_what_was_there_before_matter() {
    let (frame, other) = (noise::<f32>(67, 300), noise::<f32>(40, 20));
    let level = Level::detect();
    let one = Threads::new(Some(1)).unwrap().install(|| Spline::new(level, &frame));
    let two = Threads::new(Some(2)).unwrap().install(|| {
        let mut spline = Spline::new(level, &other);
        spline.refill(level, &frame);
        spline.refill(level, &frame.map(|v| -v));
        spline.refill(level, &frame);
        spline
    });
    assert_eq!(one.size(), two.size());
    let (x, y) = (positions::<f32>(4000, 67, 3), positions::<f32>(4000, 300, 4));
    let bits = |spline: &Spline<f32>| {
        let mut out = vec![f32::NAN; x.len()];
        spline.sample_row(level, &x, &y, &mut out);
        out.iter().map(|v| v.to_bits()).collect::<Vec<_>>()
    };
    assert_eq!(bits(&one), bits(&two));
}
