//! Row offset of the right camera.

use jacoflow::image::{GaussianSmoother, Interpolation};
use jacoflow::math::random::CounterRng;
use jacoflow::stereo::{EdgeDisparityOptions, Method, RowOffset, edge_disparity, estimate_row_offset, find_row_offset};
use jacoflow::types::Frame;

/// Soft cells seen by two cameras: the right one `offset` rows lower, disparity -3.3 px above and 2.4 px
/// below the middle.
pub fn views(offset: f64) -> [Frame<f32>; 2] {
    let rng = CounterRng::new(5);
    let cells = Frame::from_fn(240, 200, |x, y| {
        (rng.uniform((1000 * ((y + x / 3) / 11) + (x + y / 4) / 13) as u64) * 200.0) as f32
    });
    let scene = GaussianSmoother::new(1.5).unwrap().apply(&cells);
    let noisy =
        |x: usize, y: usize, value: f32, stream| value + rng.stream(stream).normal((1000 * y + x) as u64) as f32;
    let left = Frame::from_fn(180, 160, |x, y| noisy(x, y, scene.get(x + 30, y + 20), 1));
    let right = Frame::from_fn(180, 160, |x, y| {
        let row = y as f64 + 20.0 - offset;
        let disparity = if row < 100.0 { -3.3 } else { 2.4 };
        noisy(x, y, 1.02 * Interpolation::Bicubic.at(&scene, x as f64 + 30.0 + disparity, row) + 2.0, 2)
    });
    [left, right]
}

#[test]
fn nothing_to_match_is_no_offset() {
    let flat = Frame::filled(64, 64, 9.0f32);
    let found = find_row_offset(&flat, &flat, &EdgeDisparityOptions::default()).unwrap();
    assert_eq!(found, RowOffset { rows: 0.0, doubtful: false });
}

#[test]
fn rows_that_cannot_be_reported_are_not_doubted() {
    let stripes = Frame::from_fn(180, 160, |x, _| if x / 9 % 2 == 0 { 40.0f32 } else { 180.0 });
    assert!(!find_row_offset(&stripes, &stripes, &EdgeDisparityOptions::default()).unwrap().doubtful);
}

#[test]
fn offsets_between_rows_are_found_along_slanted_edges() {
    let options = EdgeDisparityOptions { disparity_range: (-8, 8), ..EdgeDisparityOptions::default() };
    for offset in [-2.3, 0.0, 0.5, 1.4] {
        let [left, right] = views(offset);
        let found = estimate_row_offset(&left, &right, &options).unwrap();
        assert!((found - offset).abs() < 0.05, "{found} for {offset}");
    }
}

#[test]
fn an_offset_beyond_the_rows_that_are_searched_is_doubted() {
    let options = |row_range| EdgeDisparityOptions { disparity_range: (-8, 8), row_range, ..Default::default() };
    for offset in [-9.0, -6.5, 6.0, 7.3] {
        let [left, right] = views(offset);
        let doubtful = |rows| find_row_offset(&left, &right, &options(rows)).unwrap().doubtful;
        assert!(doubtful((-3, 3)), "{offset}");
        assert!(!doubtful((-9, 9)), "{offset}");
        let by = |method, row_offset| {
            let options = EdgeDisparityOptions { method, row_offset, ..options((-3, 3)) };
            edge_disparity(&left, &right, &options).unwrap().rows_doubtful
        };
        for method in Method::ALL {
            assert!(by(method, None) && !by(method, Some(offset)), "{offset} {method:?}");
        }
    }
}
