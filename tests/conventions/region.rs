//! Pixels at which estimates are made.

use jacoflow::types::{Rect, SamplingGrid};

#[test]
fn grid_shape_and_pixels() {
    let region = Some(Rect { x: 2, y: 1, width: 5, height: 4 });
    let sites = SamplingGrid::Grid { region, stride: 2 };
    assert_eq!(sites.shape((10, 6)).unwrap(), (3, 2));
    assert_eq!(sites.pixel(2, 1), (6, 3));
    assert!(sites.shape((6, 6)).unwrap_err().to_string().contains("region"));
    assert!(SamplingGrid::Grid { region: None, stride: 0 }.shape((4, 4)).is_err());
}

#[test]
fn points_outside_are_named() {
    let sites = SamplingGrid::Points(vec![(1, 1), (4, 0)]);
    assert!(sites.shape((4, 4)).unwrap_err().to_string().contains("(4, 0)"));
}
