//! Frames as pictures.

use jacoflow::image::picture::{GreyRange, grey_picture};
use jacoflow::types::{AnyColourFrame, AnyFrame, Frame};

#[test]
fn bytes_are_kept_and_other_types_are_stretched() {
    let bytes = AnyFrame::U8(Frame::from_fn(3, 1, |x, _| 7 * x as u8));
    assert_eq!(grey_picture(&bytes).pixel(2, 0), [14; 3]);
    let words = AnyFrame::U16(Frame::from_fn(2, 1, |x, _| 100 + 900 * x as u16));
    assert_eq!([0, 1].map(|x| grey_picture(&words).pixel(x, 0)[0]), [0, 255]);
    let flat = AnyFrame::F32(Frame::new(2, 1, vec![f32::NAN, 5.0]).unwrap());
    assert_eq!(grey_picture(&flat).pixel(0, 0), [0; 3]);
    let darker = AnyFrame::U16(Frame::filled(2, 1, 550));
    assert_eq!(GreyRange::of(&words).picture(&darker).pixel(0, 0), [128; 3]);
}

#[test]
fn colours_share_one_range() {
    let bytes = AnyColourFrame::U8(Frame::filled(2, 1, [7, 0, 200]));
    assert_eq!(GreyRange::of_colour(&bytes).colour_picture(&bytes).pixel(1, 0), [7, 0, 200]);
    let floats = AnyColourFrame::F32(Frame::filled(2, 1, [0.25, 0.5, f32::NAN]));
    assert_eq!(GreyRange::of_colour(&floats).colour_picture(&floats).pixel(0, 0), [0, 255, 0]);
    let words = AnyColourFrame::U16(Frame::new(2, 1, vec![[100, 550, 1000]; 2]).unwrap());
    assert_eq!(GreyRange::of_colour(&words).colour_picture(&words).pixel(1, 0), [0, 128, 255]);
}
