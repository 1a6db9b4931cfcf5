//! Gradients of a Gaussian-smoothed frame.

use jacoflow::image::{Border, gaussian_gradient};
use jacoflow::simd::Level;
use jacoflow::types::Frame;

#[test]
fn a_plane_has_its_slopes_and_a_step_its_height() {
    let plane = Frame::from_fn(40, 40, |x, y| 3.0f64 * x as f64 - 0.5 * y as f64);
    let (gx, gy) = gaussian_gradient(Level::detect(), &plane, 2.0, 8);
    assert!((gx.get(20, 20) - 3.0 * 0.9996).abs() < 1e-3 && (gy.get(20, 20) + 0.5 * 0.9996).abs() < 1e-3);
    let step = Frame::from_fn(41, 41, |_, y| if y < 20 { 0.0f64 } else { 100.0 });
    let (gx, gy) = gaussian_gradient(Level::detect(), &step, 2.0, 8);
    let peak = 100.0 / (2.0 * (2.0 * std::f64::consts::PI).sqrt());
    assert!(gx.get(20, 20).abs() < 1e-9 && (gy.get(20, 20) / peak - 1.0).abs() < 0.04, "{}", gy.get(20, 20));
}

#[test]
fn every_level_agrees_with_the_direct_sum() {
    let frame = Frame::from_fn(37, 23, |x, y| ((7 * x + 13 * y * y) % 31) as f32);
    let (sigma, radius) = (1.0f64, 4isize);
    let g = |k: isize| (-0.5 * (k as f64 / sigma).powi(2)).exp() / (sigma * (2.0 * std::f64::consts::PI).sqrt());
    let d = |k: isize| -(k as f64) / (sigma * sigma) * g(k);
    for level in Level::available() {
        let (gx, gy) = gaussian_gradient(level, &frame, sigma, radius as usize);
        for (x, y) in [(0usize, 0usize), (1, 20), (18, 11), (36, 22), (30, 2)] {
            let (mut want_x, mut want_y) = (0.0, 0.0);
            for j in -radius..=radius {
                for i in -radius..=radius {
                    let column = Border::Replicate.index(x as isize - i, 37);
                    let value = f64::from(frame.get(column, Border::Replicate.index(y as isize - j, 23)));
                    want_x += value * d(i) * g(j);
                    want_y += value * g(i) * d(j);
                }
            }
            assert!((f64::from(gx.get(x, y)) - want_x).abs() < 1e-4, "{level:?} {x} {y}");
            assert!((f64::from(gy.get(x, y)) - want_y).abs() < 1e-4, "{level:?} {x} {y}");
        }
    }
}

#[test]
fn a_bad_sample_damages_its_neighbourhood_and_no_more() {
    let mut frame = Frame::from_fn(40, 40, |x, y| (x * y) as f32);
    frame.data_mut()[20 * 40 + 20] = f32::NAN;
    let (gx, gy) = gaussian_gradient(Level::detect(), &frame, 2.0, 8);
    for y in 0..40usize {
        for x in 0..40usize {
            let near = x.abs_diff(20) <= 8 && y.abs_diff(20) <= 8;
            assert_eq!((gx.get(x, y).is_nan(), gy.get(x, y).is_nan()), (near, near), "{x} {y}");
        }
    }
}
