//! State of a tracked target, frame by frame.

use jacoflow::types::{TargetBox, TrackStatus};

#[test]
fn boxes_overlap_by_their_common_area() {
    let a = TargetBox::about([5.0, 5.0], 4.0, 2.0);
    assert_eq!((a.x, a.y, a.centre()), (3.0, 4.0, [5.0, 5.0]));
    assert_eq!(a.overlap(&a), 1.0);
    assert_eq!(a.overlap(&TargetBox { x: 5.0, ..a }), 1.0 / 3.0);
    assert_eq!(a.overlap(&TargetBox { x: 7.0, ..a }), 0.0);
    assert_eq!(TargetBox { x: 0.0, y: 0.0, width: 0.0, height: 0.0 }.overlap(&a), 0.0);
}

#[test]
fn codes_count_up() {
    for (code, status) in TrackStatus::ALL.into_iter().enumerate() {
        assert_eq!(status as usize, code);
    }
    assert!(TrackStatus::Occluded.is_measured() && !TrackStatus::Out.is_measured());
}
