use super::*;
use crate::types::AffineFlow;

/// Smooth waves, as they are at a place of the first frame.
pub fn waves(x: f64, y: f64) -> f64 {
    128.0 + 40.0 * (0.31 * x + 0.11 * y).sin() + 35.0 * (0.23 * y - 0.13 * x).cos()
}

/// Frames whose second shows the first one moved: `x' = x + u + A (x - c)`.
pub fn pair(translation: [f64; 2], a: [f64; 4]) -> (SmoothedLevels, SmoothedLevels) {
    let first = Frame::from_fn(120, 100, |x, y| waves(x as f64, y as f64) as f32);
    let [p, q, r, s] = [1.0 + a[0], a[1], a[2], 1.0 + a[3]];
    let determinant = p * s - q * r;
    let second = Frame::from_fn(120, 100, |x, y| {
        let (dx, dy) = (x as f64 - 60.0 - translation[0], y as f64 - 50.0 - translation[1]);
        waves(60.0 + (s * dx - q * dy) / determinant, 50.0 + (p * dy - r * dx) / determinant) as f32
    });
    (SmoothedLevels::new(&first), SmoothedLevels::new(&second))
}

pub fn pixels() -> Vec<[f64; 2]> {
    (0..31).flat_map(|j| (0..41).map(move |i| [40.0 + f64::from(i), 35.0 + f64::from(j)])).collect()
}

#[test]
fn an_affine_motion_is_found() {
    let (first, second) = pair([3.4, -2.7], [0.02, 0.015, -0.01, 0.03]);
    let found = affine_motion(&first, &second, &pixels(), &[[0.0, 0.0]]).unwrap();
    let (u, v) = found.flow.at_offset(60.0 - found.centre[0], 50.0 - found.centre[1]);
    let found = PlaneMotion { flow: AffineFlow { u, v, ..found.flow }, ..found };
    let want = [3.4, -2.7, 0.02, -0.01, 0.015, 0.03];
    for (got, (want, tolerance)) in
        found.flow.to_array().into_iter().zip(want.into_iter().zip([0.02; 2].into_iter().chain([0.002; 4])))
    {
        assert!((got - want).abs() < tolerance, "{:?}", found.flow);
    }
    assert!((found.centre[0] - 60.0).abs() < 3.0 && (found.centre[1] - 50.0).abs() < 3.0, "{:?}", found.centre);
    let moved = PlaneMotion { centre: [60.0, 50.0], ..found }.moved(70.0, 50.0);
    assert!((moved[0] - 73.6).abs() < 0.05 && (moved[1] - 47.2).abs() < 0.05);
}

#[test]
fn the_start_with_the_smaller_residual_wins() {
    let (first, second) = pair([17.0, 9.0], [0.0; 4]);
    let found = affine_motion(&first, &second, &pixels(), &[[-9.0, 0.0], [16.0, 8.0]]).unwrap();
    assert!((found.flow.u - 17.0).abs() < 0.02 && (found.flow.v - 9.0).abs() < 0.02, "{found:?}");
}

#[test]
fn what_covers_a_quarter_hardly_matters() {
    let (first, mut second) = pair([1.5, 0.5], [0.0; 4]);
    for frame in &mut second.0 {
        for y in 0..100 {
            frame.row_mut(y)[70..].fill(20.0);
        }
    }
    let found = affine_motion(&first, &second, &pixels(), &[[0.0, 0.0]]).unwrap();
    assert!((found.flow.u - 1.5).abs() < 0.1 && (found.flow.v - 0.5).abs() < 0.1, "{found:?}");
}
