//! Boxes of tracks as text in the form of the MOT challenge, and what is read back from it.

use jacoflow::error::Error;
use jacoflow::io::{MotBox, MotTable, read_mot};
use jacoflow::types::{TargetBox, TrackState, TrackStatus};

fn state(bounds: TargetBox, status: TrackStatus) -> TrackState {
    TrackState { status, visibility: 0.75, ..TrackState::at(bounds.centre(), bounds) }
}

#[test]
fn lines_count_from_one_and_leave_out_who_is_gone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.txt");
    // Pixels 10 to 22 and 20 to 24.
    let bounds = TargetBox { x: 9.5, y: 19.5, width: 13.0, height: 5.0 };
    let unknown = TargetBox { x: f64::NAN, ..bounds };
    let mut table = MotTable::create(&path).unwrap();
    for (target, status) in TrackStatus::ALL.into_iter().enumerate() {
        table.write(target + 1, 0, &state(bounds, status)).unwrap();
    }
    table.write(1, 1, &state(unknown, TrackStatus::Tracking)).unwrap();
    table.write(2, 1, &state(TargetBox { x: -1.50004, ..bounds }, TrackStatus::Tracking)).unwrap();
    table.finish().unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(
        lines,
        [
            "1,1,11,21,13,5,0.75,-1,-1,-1",
            "1,2,11,21,13,5,0.75,-1,-1,-1",
            "1,3,11,21,13,5,0,-1,-1,-1",
            "2,2,0,21,13,5,0.75,-1,-1,-1"
        ]
    );
    let read = read_mot(&path).unwrap();
    assert_eq!(read.len(), 4);
    assert_eq!(read[1], MotBox { frame: 0, target: 2, bounds, confidence: 0.75 });
    assert_eq!((read[3].frame, read[3].bounds.x), (1, -1.5));
}

#[test]
fn truth_and_detections_are_read_and_damage_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("gt.txt");
    std::fs::write(&path, "\u{feff}3, 2, 794.27, 247.59, 71.245, 174.88, 0, 1, 0.86\r\n\n1 -1 1 1 4 4\n").unwrap();
    let read = read_mot(&path).unwrap();
    assert_eq!((read[0].frame, read[0].target, read[0].confidence), (2, 2, 0.0));
    assert_eq!((read[1].target, read[1].bounds.x, read[1].confidence), (-1, -0.5, 1.0));
    for (damage, line) in
        [("1,1,1,1,4,4\n0,1,1,1,4,4", 2), ("1,1,1,1,4", 1), ("1,1,1,1,0,4", 1), ("1,1,nan,1,4,4", 1), ("a,b", 1)]
    {
        std::fs::write(&path, damage).unwrap();
        let error = read_mot(&path).unwrap_err();
        assert!(matches!(error, Error::Format { .. }), "{error}");
        assert!(error.to_string().contains(&format!("line {line}")), "{damage:?}: {error}");
    }
    std::fs::write(&path, [0xff, 0xfe, 0]).unwrap();
    assert!(matches!(read_mot(&path), Err(Error::Format { .. })));
    std::fs::write(&path, "1\t-1\t1\t1\t4;4").unwrap();
    assert_eq!(read_mot(&path).unwrap(), read[1..]);
    assert!(matches!(read_mot(folder.path().join("none.txt")), Err(Error::Io { .. })));
}
