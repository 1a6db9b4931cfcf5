//! Halved frames and masks against the double sum.

use jacoflow::image::{halve, halve_into, halve_mask};
use jacoflow::math::Real;
use jacoflow::math::random::CounterRng;
use jacoflow::parallel::Threads;
use jacoflow::simd::Level;
use jacoflow::types::Frame;

fn noise<T: Real>(width: usize, height: usize) -> Frame<T> {
    let rng = CounterRng::new(3);
    Frame::from_fn(width, height, |x, y| T::from_f64(255.0 * rng.uniform((y * width + x) as u64)))
}

/// The double sum of the definition.
fn naive<T: Real>(frame: &Frame<T>, x: usize, y: usize) -> f64 {
    let (w, h) = frame.size();
    let (mut sum, mut total) = (0.0, 0.0);
    for j in -3isize..=3 {
        for i in -3isize..=3 {
            let weight = (-0.5 * (i * i + j * j) as f64).exp();
            let px = (2 * x as isize + i).clamp(0, w as isize - 1) as usize;
            let py = (2 * y as isize + j).clamp(0, h as isize - 1) as usize;
            sum += weight * frame.get(px, py).to_f64();
            total += weight;
        }
    }
    sum / total
}

const SIZES: [(usize, usize); 9] = [(1, 1), (2, 1), (1, 6), (3, 2), (16, 9), (33, 40), (64, 35), (131, 3), (150, 71)];

macro_rules! check {
    ($t:ty, $tolerance:expr) => {{
        type T = $t;
        for (w, h) in SIZES {
            let frame = noise::<T>(w, h);
            for level in Level::available() {
                let half = halve(level, &frame);
                assert_eq!(half.size(), (w.div_ceil(2), h.div_ceil(2)));
                for y in 0..half.height() {
                    for x in 0..half.width() {
                        let (got, want) = (half.get(x, y).to_f64(), naive(&frame, x, y));
                        assert!((got - want).abs() < $tolerance, "{w} x {h}, {level:?} at {x}, {y}: {got} {want}");
                    }
                }
            }
        }
    }};
}

#[test]
fn every_level_is_the_double_sum() {
    check!(f32, 2e-4);
    check!(f64, 1e-12);
}

#[test]
fn a_plane_keeps_its_place() {
    // Pixel i of the result lies at pixel 2 i: no shift by half a pixel.
    let frame = Frame::from_fn(40, 30, |x, y| 3.0 * x as f64 - 2.0 * y as f64);
    let half = halve(Level::detect(), &frame);
    for y in 2..13 {
        for x in 2..18 {
            assert!((half.get(x, y) - (6.0 * x as f64 - 4.0 * y as f64)).abs() < 1e-12);
        }
    }
}

#[test]
fn neither_threads_nor_what_was_there_before_matter() {
    let (frame, level) = (noise::<f32>(75, 130), Level::detect());
    let one = Threads::new(Some(1)).unwrap().install(|| halve(level, &frame));
    for mut out in [Frame::default(), Frame::filled(9, 9, 1.0), Frame::filled(38, 65, f32::NAN)] {
        Threads::new(Some(2)).unwrap().install(|| halve_into(level, &frame, &mut out));
        assert_eq!(one, out);
    }
}

#[test]
fn empty_frames_stay_empty() {
    for (w, h) in [(0, 0), (0, 3), (3, 0)] {
        assert!(halve(Level::detect(), &Frame::filled(w, h, 1.0f32)).data().is_empty());
        assert_eq!(halve_mask(&Frame::filled(w, h, true)).size(), (w.div_ceil(2), h.div_ceil(2)));
    }
}

#[test]
fn a_coarse_pixel_is_usable_when_half_of_its_surroundings_are() {
    let rng = CounterRng::new(5);
    for (w, h) in SIZES {
        let mask = Frame::from_fn(w, h, |x, y| rng.uniform((y * w + x) as u64) < 0.6);
        let half = halve_mask(&mask);
        assert_eq!(half.size(), (w.div_ceil(2), h.div_ceil(2)));
        for y in 0..half.height() {
            for x in 0..half.width() {
                let mut share = 0.0;
                for (j, b) in [(-1isize, 0.25), (0, 0.5), (1, 0.25)] {
                    for (i, a) in [(-1isize, 0.25), (0, 0.5), (1, 0.25)] {
                        let px = (2 * x as isize + i).clamp(0, w as isize - 1) as usize;
                        let py = (2 * y as isize + j).clamp(0, h as isize - 1) as usize;
                        share += if mask.get(px, py) { a * b } else { 0.0 };
                    }
                }
                assert_eq!(half.get(x, y), share >= 0.5, "{w} x {h} at {x}, {y}");
            }
        }
    }
}
