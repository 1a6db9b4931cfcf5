//! Pictures and frames as PNG, whole or not at all.

use jacoflow::error::Error;
use jacoflow::image::picture::Picture;
use jacoflow::io::{Colour, read_image, write_frame_png, write_picture};
use jacoflow::types::{AnyFrame, Frame};

#[test]
fn frames_and_pictures_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    for frame in [
        AnyFrame::U8(Frame::from_fn(5, 3, |x, y| (40 * x + y) as u8)),
        AnyFrame::U16(Frame::from_fn(5, 3, |x, y| (9000 * x + y) as u16)),
    ] {
        write_frame_png(&path, &frame).unwrap();
        assert_eq!(read_image(&path, Colour::Error).unwrap(), frame);
    }
    write_picture(&path, &Picture::filled(2, 1, [255, 0, 0])).unwrap();
    assert_eq!(read_image(&path, Colour::Luminance).unwrap(), AnyFrame::U8(Frame::filled(2, 1, 76)));
}

#[test]
fn what_png_cannot_hold_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let error = write_frame_png(&path, &AnyFrame::F32(Frame::filled(2, 2, 0.5))).unwrap_err();
    assert!(matches!(error, Error::Type { argument: "frame", .. }));
    assert!(write_picture(&path, &Picture::filled(0, 3, [0; 3])).is_err());
    assert!(!path.exists());
}
