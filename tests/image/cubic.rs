//! Cubic convolution at many places.

use jacoflow::image::{Interpolation, cubic_at, cubic_at_all};
use jacoflow::math::random::CounterRng;
use jacoflow::simd::Level;
use jacoflow::types::Frame;

#[test]
fn many_places_are_read_like_single_ones() {
    let rng = CounterRng::new(5);
    for (width, height) in [(31, 23), (4, 9), (3, 2), (1, 1)] {
        let frame = Frame::from_fn(width, height, |x, y| 100.0 + 30.0 * rng.normal((y * width + x) as u64));
        let origin = [7.0, 3.0];
        let at = |from: f64, length: usize, k: u64| from - 2.0 + rng.uniform(k) * (length as f64 + 4.0);
        let mut x: Vec<f64> = (0..203).map(|k| at(origin[0], width, 1000 + k)).collect();
        let mut y: Vec<f64> = (0..203).map(|k| at(origin[1], height, 5000 + k)).collect();
        // Places on pixels and on the outermost ones that have all neighbours.
        x.extend([8.0, 7.0 + width as f64 - 2.0, 7.0]);
        y.extend([4.0, 3.0 + height as f64 - 2.0, 3.0]);
        let want: Vec<f64> = x.iter().zip(&y).map(|(x, y)| cubic_at(&frame, x - origin[0], y - origin[1])).collect();
        for level in Level::available() {
            let mut got = vec![f64::NAN; x.len()];
            cubic_at_all(level, &frame, origin, (&x, &y), &mut got);
            for (g, w) in got.iter().zip(&want) {
                assert!((g - w).abs() < 1e-9, "{level:?} {width} x {height}: {g} {w}");
            }
        }
    }
}

#[test]
fn inside_it_is_the_interpolation_of_that_name() {
    let frame = Frame::from_fn(9, 8, |x, y| ((x * x) as f64).sin() + 0.3 * (x * y) as f64);
    for (x, y) in [(3.25, 4.75), (1.0, 1.5), (6.9, 5.9)] {
        assert!((cubic_at(&frame, x, y) - Interpolation::Bicubic.at(&frame, x, y)).abs() < 1e-12);
    }
    assert_eq!(cubic_at(&frame, -5.0, 90.0), frame.get(0, 7));
}
