//! The row offset of a sequence.

use super::row_offset::views;
use jacoflow::math::random::CounterRng;
use jacoflow::stereo::{EdgeDisparity, EdgeDisparityOptions, SequenceRows, edge_disparity};
use jacoflow::types::Frame;

fn options() -> EdgeDisparityOptions {
    EdgeDisparityOptions { disparity_range: (-8, 8), ..EdgeDisparityOptions::default() }
}

/// Views that show nothing, noise, and a title drawn into both alike.
fn openings() -> [[Frame<f32>; 2]; 3] {
    let noise =
        |seed| Frame::from_fn(180, 160, |x, y| 40.0 * CounterRng::new(seed).uniform((1000 * y + x) as u64) as f32);
    let title = Frame::from_fn(180, 160, |x, y| {
        let bar = (40..46).contains(&y) && (20..160).contains(&x);
        let strokes = (70..100).contains(&y) && (20..160).contains(&x) && x / 6 % 3 == 0;
        if bar || strokes { 230.0 } else { 20.0 }
    });
    [[Frame::filled(180, 160, 16.0), Frame::filled(180, 160, 16.0)], [noise(1), noise(2)], [title.clone(), title]]
}

/// All that was matched, without the pixels that were not, which are NaN.
fn said(found: &EdgeDisparity) -> (&[u32], &[u32], &[f32], f64) {
    (&found.rows, &found.columns, &found.values, found.row_offset)
}

#[test]
fn rows_are_found_however_a_sequence_begins() {
    for opening in openings() {
        let mut rows = SequenceRows::new(None);
        rows.match_next(&opening[0], &opening[1], &options()).unwrap();
        for offset in [1.4, 1.4, -2.3] {
            let [left, right] = views(offset);
            let found = rows.match_next(&left, &right, &options()).unwrap();
            assert!((found.row_offset - offset).abs() < 0.05, "{} for {offset}", found.row_offset);
            assert_eq!(rows.known(), Some(found.row_offset));
        }
    }
}

#[test]
fn what_shows_nothing_settles_nothing_and_changes_nothing() {
    let [black, noise, _] = openings();
    let mut rows = SequenceRows::new(None);
    for pair in [&black, &noise] {
        rows.match_next(&pair[0], &pair[1], &options()).unwrap();
        assert_eq!(rows.known(), None);
    }
    let [left, right] = views(0.5);
    let first = rows.match_next(&left, &right, &options()).unwrap();
    for pair in [&black, &noise] {
        assert_eq!(rows.match_next(&pair[0], &pair[1], &options()).unwrap().row_offset, first.row_offset);
    }
    // The same offset, to the last bit, as long as views agree with it.
    assert_eq!(said(&rows.match_next(&left, &right, &options()).unwrap()), said(&first));
    assert_eq!(rows.known(), Some(first.row_offset));
}

#[test]
fn an_offset_that_is_given_is_kept() {
    let [left, right] = views(1.4);
    let mut rows = SequenceRows::new(Some(1.0));
    let found = rows.match_next(&left, &right, &options()).unwrap();
    assert_eq!((found.row_offset, rows.known()), (1.0, Some(1.0)));
    let given = EdgeDisparityOptions { row_offset: Some(1.0), ..options() };
    assert_eq!(said(&found), said(&edge_disparity(&left, &right, &given).unwrap()));
}
