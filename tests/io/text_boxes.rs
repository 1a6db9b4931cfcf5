//! Boxes of one target a line, as the object tracking benchmark (OTB) keeps its ground truth; and the reading

use jacoflow::error::Error;
use jacoflow::io::read_otb;
use jacoflow::types::TargetBox;

#[test]
fn boxes_are_read_whatever_separates_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("groundtruth_rect.txt");
    std::fs::write(&path, "\u{feff}11,21,13,5\n11\t21\t13\t5\r\n 11 21  13 5\n0,0,0,0\nNaN,NaN,NaN,NaN\n").unwrap();
    let bounds = TargetBox { x: 9.5, y: 19.5, width: 13.0, height: 5.0 };
    assert_eq!(read_otb(&path).unwrap(), [Some(bounds), Some(bounds), Some(bounds), None, None]);
    // The benchmark's own centre of a box, x + (w - 1) / 2 counted from 1, is ours.
    assert_eq!(bounds.centre(), [11.0 + 6.0 - 1.0, 21.0 + 2.0 - 1.0]);
}

#[test]
fn damage_is_named_by_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.txt");
    for (damage, words) in [("1,2,3,4\n1,2,3", "line 2"), ("1,2,3,x", "line 1"), ("\n\n1,2,3,4,5", "line 3")] {
        std::fs::write(&path, damage).unwrap();
        let error = read_otb(&path).unwrap_err().to_string();
        assert!(error.contains(words) && error.contains("a.txt"), "{error}");
    }
    std::fs::write(&path, [0xff, 0xfe, 0]).unwrap();
    assert!(matches!(read_otb(&path), Err(Error::Format { .. })));
    assert!(matches!(read_otb(folder.path().join("none")), Err(Error::Io { .. })));
}
