//! Brightness between the pixels.

use jacoflow::image::{Interpolation, lagrange_at};
use jacoflow::types::Frame;
use proptest::prelude::*;

fn quadratic(x: f64, y: f64) -> f64 {
    3.0 + 0.5 * x - 0.25 * y + 0.125 * x * x - 0.0625 * x * y + 0.2 * y * y
}

#[test]
fn outside_and_nan_are_nan_and_pixels_are_exact() {
    let mut frame = Frame::from_fn(6, 5, |x, y| (10 * y + x) as f32);
    frame.row_mut(0)[0] = f32::NAN;
    for how in [Interpolation::Bilinear, Interpolation::Bicubic] {
        assert_eq!(how.at(&frame, 5.0, 4.0), 45.0);
        assert_eq!(how.at(&frame, 1.0, 0.0), 1.0);
        for (x, y) in [(-0.01, 1.0), (5.01, 1.0), (1.0, 4.5), (f64::NAN, 1.0), (0.5, 0.0)] {
            assert!(how.at(&frame, x, y).is_nan(), "{how:?} at {x}, {y}");
        }
    }
    assert!(Interpolation::Bilinear.at(&frame, 1.5, 0.0) == 1.5);
    assert!(Interpolation::Bilinear.at(&Frame::<f32>::new(0, 0, vec![]).unwrap(), 0.0, 0.0).is_nan());
}

proptest! {
    #[test]
    fn bicubic_is_exact_for_quadratics(x in 1.0..6.0f64, y in 1.0..5.0f64) {
        let frame = Frame::from_fn(8, 7, |x, y| quadratic(x as f64, y as f64));
        prop_assert!((Interpolation::Bicubic.at(&frame, x, y) - quadratic(x, y)).abs() < 1e-12);
    }

    #[test]
    fn bilinear_is_exact_for_planes(x in 0.0..7.0f64, y in 0.0..6.0f64) {
        let frame = Frame::from_fn(8, 7, |x, y| 2.0 * x as f64 - y as f64);
        prop_assert!((Interpolation::Bilinear.at(&frame, x, y) - (2.0 * x - y)).abs() < 1e-12);
    }
}

#[test]
fn six_pixels_along_each_axis_hold_fifth_powers() {
    let exact = |x: f64, y: f64| 1.0 + (x - 4.0).powi(5) - 2.0 * (y - 3.5).powi(5) + 0.3 * (x * y).powi(2);
    let mut frame = Frame::from_fn(11, 10, |x, y| exact(x as f64, y as f64));
    for (x, y) in [(4.3, 5.8), (2.0, 2.5), (7.99, 6.01), (3.0, 4.0)] {
        assert!((lagrange_at(&frame, x, y) - exact(x, y)).abs() < 1e-9, "{x} {y}");
    }
    assert_eq!(lagrange_at(&frame, -5.0, 90.0), frame.get(0, 9));
    frame.row_mut(5)[5] = f64::NAN;
    assert!(lagrange_at(&frame, 7.5, 3.0).is_nan() && lagrange_at(&frame, 8.0, 3.0).is_finite());
}
