//! Grey images in memory.

use jacoflow::types::{AnyColourFrame, Frame, Sample};

#[test]
fn size_must_match_the_samples() {
    assert!(Frame::new(3, 2, vec![0u8; 6]).is_ok());
    assert!(Frame::new(3, 2, vec![0u8; 5]).unwrap_err().to_string().contains("data"));
    assert!(Frame::new(usize::MAX, 2, vec![0u8; 5]).is_err());
}

#[test]
fn nearest_samples_round_and_saturate() {
    assert_eq!(u8::from_f64_nearest(254.5), 255);
    assert_eq!((u8::from_f64_nearest(-3.0), u8::from_f64_nearest(1e9), u8::from_f64_nearest(f64::NAN)), (0, 255, 0));
    assert_eq!(u16::from_f64_nearest(65534.4), 65534);
    assert_eq!(f32::from_f64_nearest(0.1), 0.1);
}

#[test]
fn rows_and_samples_are_addressed_as_y_x() {
    let frame = Frame::from_fn(3, 2, |x, y| 10 * y + x);
    assert_eq!(frame.row(1), &[10, 11, 12]);
    assert_eq!(frame.get(2, 1), 12);
}

#[test]
fn colour_samples_are_scaled_in_single_precision() {
    let frame = AnyColourFrame::U16(Frame::new(1, 1, vec![[0, 257, 65535]]).unwrap());
    assert_eq!((frame.size(), frame.dtype()), ((1, 1), "uint16"));
    assert_eq!(frame.scaled(1.0 / 257.0).data(), [[0.0, 1.0, 255.0]]);
}
