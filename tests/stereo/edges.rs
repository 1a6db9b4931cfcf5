//! Edge pixels, and the class of every pixel's gradient direction: (2), (3) and (5) of the paper.

use jacoflow::stereo::{EdgeMap, EdgeSettings};
use jacoflow::types::Frame;

const SETTINGS: EdgeSettings = EdgeSettings { blur_sigma: 2.0, threshold: 2.0, classes: 12 };

#[test]
fn a_step_is_one_edge_of_one_class() {
    let bright_right = Frame::from_fn(40, 30, |x, _| if x < 20 { 50.0f32 } else { 150.0 });
    let map = EdgeMap::new(&bright_right, &SETTINGS);
    // One pixel in every row but the outermost.
    assert_eq!(map.rows, (1..29).collect::<Vec<u32>>());
    assert!(map.columns.iter().all(|&x| x == map.columns[0]) && (19..=20).contains(&map.columns[0]));
    assert_eq!(map.class.get(19, 15), 0);
    assert_eq!(EdgeMap::new(&bright_right.map(|v| 255.0 - v), &SETTINGS).class.get(19, 15), 6);
    let bright_below = Frame::from_fn(40, 30, |_, y| if y < 15 { 50.0f32 } else { 150.0 });
    assert_eq!(EdgeMap::new(&bright_below, &SETTINGS).class.get(19, 15), 3);
}

#[test]
fn nothing_is_found_in_a_uniform_view_or_near_a_bad_sample() {
    assert!(EdgeMap::new(&Frame::filled(20, 20, 7.0f32), &SETTINGS).is_empty());
    let mut view = Frame::from_fn(60, 60, |x, _| if x < 30 { 50.0f32 } else { 150.0 });
    view.data_mut()[30 * 60 + 30] = f32::INFINITY;
    let map = EdgeMap::new(&view, &SETTINGS);
    assert!(map.rows.iter().all(|&y| y.abs_diff(30) > 8) && map.len() > 30);
}
