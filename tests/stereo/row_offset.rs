//! Row offset of the right camera.

use jacoflow::stereo::{EdgeDisparityOptions, RowOffset, find_row_offset};
use jacoflow::types::Frame;

#[test]
fn nothing_to_match_is_no_offset() {
    let flat = Frame::filled(64, 64, 9.0f32);
    let found = find_row_offset(&flat, &flat, &EdgeDisparityOptions::default()).unwrap();
    assert_eq!(found, RowOffset { rows: 0.0, doubtful: false });
}

#[test]
fn rows_that_cannot_be_told_are_not_doubted() {
    let stripes = Frame::from_fn(180, 160, |x, _| if x / 9 % 2 == 0 { 40.0f32 } else { 180.0 });
    assert!(!find_row_offset(&stripes, &stripes, &EdgeDisparityOptions::default()).unwrap().doubtful);
}
